//! Documentation: links, documented commands, error messages and vocabulary.

mod docs_links;
mod documented_commands;
mod error_messages;
mod prose;
