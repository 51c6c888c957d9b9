//! Layers and folders of the workspace, and the page of columns.

#![expect(clippy::unwrap_used, reason = "a test that cannot read its input has failed")]

mod architecture;
mod columns_page;
