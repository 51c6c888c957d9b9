//! The `freeplay` command, as its users type it.
