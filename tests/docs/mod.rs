//! Documentation: links, documented commands, and error messages.

mod docs_links;
mod documented_commands;
mod error_messages;
