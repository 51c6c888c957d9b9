//! `completions` and `man`: shell completions and manual page.

use clap::CommandFactory;

use crate::args::{Args, CompletionsArgs};
use crate::exit::{Code, Failure};
use crate::output::Output;

/// Writes completions for a shell.
///
/// # Errors
/// If stdout is closed or full.
pub(crate) fn completions(args: &CompletionsArgs, output: &Output) -> Result<Code, Failure> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Args::command(), "freeplay", &mut text);
    output.write_exact(&String::from_utf8_lossy(&text))?;
    Ok(Code::Success)
}

/// Writes the manual page: the program, then each of its commands.
///
/// # Errors
/// If stdout is closed or full.
pub(crate) fn man(output: &Output) -> Result<Code, Failure> {
    let mut text = Vec::new();
    let command = Args::command();
    clap_mangen::Man::new(command.clone()).render(&mut text)?;
    for sub in command.get_subcommands() {
        clap_mangen::Man::new(sub.clone()).render_description_section(&mut text)?;
        clap_mangen::Man::new(sub.clone()).render_options_section(&mut text)?;
    }
    output.write_exact(&String::from_utf8_lossy(&text))?;
    Ok(Code::Success)
}
