//! `completions` and `man`: shell completions and manual page.

use clap::CommandFactory;
use clap_complete::env::Shells;

use crate::args::{Args, CompletionsArgs};
use crate::{Code, Failure, Output};

/// Writes the script by which a shell asks this program for completions.
pub(crate) fn completions(args: &CompletionsArgs, output: &Output) -> Result<Code, Failure> {
    let mut text = Vec::new();
    let shells = Shells::builtins();
    let shell = shells.completer(&args.shell.to_string());
    let shell = shell.ok_or_else(|| std::io::Error::other("the shell has no completions"))?;
    shell.write_registration("COMPLETE", "freeplay", "freeplay", "freeplay", &mut text)?;
    output.write_exact(&String::from_utf8_lossy(&text))?;
    Ok(Code::Success)
}

/// Writes the manual page: the program, then each of its commands.
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
