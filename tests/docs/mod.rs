//! Documentation: links, documented commands, error messages, and walk-throughs.

mod docs_links;
mod documented_commands;
mod walk_throughs;
