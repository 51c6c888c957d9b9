//! Console output: results to stdout, messages to stderr, colour only on terminals.

use std::ffi::OsString;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::ColorChoice;
use job::Config;
use records::Diagnostic;
use records::sanitize::{escape_cell, escape_invisible};

use pipeline::Event;
use pipeline::logs::discover;

use crate::args::{Global, LogFormat};
use crate::exit::{Code, Failure};
use crate::json_log;

const SHOWN_WHOLE: usize = 3;

/// Whether all three streams are terminals: only then are progress bars and colour used.
pub(crate) fn is_attended() -> bool {
    io::stdin().is_terminal() && io::stdout().is_terminal() && io::stderr().is_terminal()
}

#[derive(Debug, Clone)]
pub(crate) struct Output {
    quiet: bool,
    verbose: u8,
    progress: bool,
    color: bool,
    form: LogFormat,
    configs: Vec<PathBuf>,
}

impl Output {
    /// Sets up the output from the options, the terminal and `NO_COLOR`.
    pub(crate) fn new(global: &Global) -> Self {
        let auto = std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty()) && is_attended();
        let color = match global.color {
            ColorChoice::Always => true,
            ColorChoice::Never => false,
            ColorChoice::Auto => auto,
        };
        let json = global.log_format == LogFormat::Json;
        Self {
            quiet: global.quiet,
            verbose: global.verbose,
            progress: !(global.no_progress || global.quiet || json),
            color,
            form: global.log_format,
            configs: global.config.clone(),
        }
    }

    /// Refuses to write over an input: a configuration file, a table or a log that it names, a file that the command names
    /// twice; or into the store.
    ///
    /// # Errors
    /// If the file is one of them.
    pub(crate) fn refuse_input(&self, file: &Path) -> Result<(), Failure> {
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let Ok(folder) = folder.canonicalize() else { return Ok(()) };
        let target =
            file.canonicalize().unwrap_or_else(|_| folder.join(file.file_name().unwrap_or_default()));
        let mut inputs = self.configs.clone();
        let mut is_inside = false;
        if let Ok(config) = Config::read_settings(&self.configs) {
            inputs.extend(config.document.logs.tables().map(|table| config.path(table)));
            is_inside = config.store().canonicalize().is_ok_and(|store| target.starts_with(store))
                || (target.exists() && discover::is_log(&config, &target));
        }
        let is_target = |input: &Path| input.canonicalize().is_ok_and(|input| input == target);
        // An option and its value are one argument in `--output=FILE` and `-oFILE`.
        let is_named = |argument: &OsString| {
            let text = argument.to_string_lossy();
            let value = text.split_once('=').map(|(_, value)| value).or_else(|| text.strip_prefix("-o"));
            is_target(Path::new(argument)) || value.is_some_and(|value| is_target(Path::new(value)))
        };
        let times_named = std::env::args_os().filter(is_named).count();
        if !is_inside && times_named < 2 && !inputs.iter().any(|input| is_target(input)) {
            return Ok(());
        }
        let what = format!("{} is an input or a part of the store; it was not changed", file.display());
        Err(Failure::usage("would_overwrite", what, "name another output file"))
    }

    pub(crate) fn shows_progress(&self) -> bool {
        self.progress
    }

    pub(crate) fn is_verbose(&self) -> bool {
        self.verbose > 0
    }

    /// Writes a result for people to stdout, its invisible characters as code points.
    pub(crate) fn write_result(&self, text: &str) -> Result<(), Failure> {
        let text = escape_invisible(text);
        if self.color { self.write_exact(&with_coloured_states(&text)) } else { self.write_exact(&text) }
    }

    /// Writes a result for programs to stdout, character by character.
    #[expect(clippy::unused_self, reason = "only who holds the output may write")]
    pub(crate) fn write_exact(&self, text: &str) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        out.write_all(text.as_bytes())?;
        Ok(out.flush()?)
    }

    pub(crate) fn note(&self, text: &str) {
        if !self.quiet {
            self.err(&if self.is_json() { json_log::note(text) } else { escape(text) });
        }
    }

    /// Writes an event of a run as a JSON line; in text format the progress is shown instead.
    pub(crate) fn event(&self, event: &Event) {
        if self.is_json() && !self.quiet {
            self.err(&json_log::event(event));
        }
    }

    pub(crate) fn diagnostic(&self, diagnostic: &Diagnostic) {
        if self.is_json() {
            return self.err(&json_log::diagnostic(diagnostic));
        }
        let text = diagnostic.to_string();
        self.err(&if self.color { coloured(&text) } else { text });
    }

    /// Shows the first few diagnostics of each code, and how many more there are.
    pub(crate) fn diagnostics<'c>(&self, diagnostics: impl IntoIterator<Item = &'c Diagnostic>) {
        let mut seen: std::collections::BTreeMap<&str, usize> = std::collections::BTreeMap::new();
        for diagnostic in diagnostics {
            let count = seen.entry(&diagnostic.code).or_default();
            *count += 1;
            if *count <= SHOWN_WHOLE || self.shows_all() {
                self.diagnostic(diagnostic);
            }
        }
        let more = seen.into_iter().filter(|(_, count)| *count > SHOWN_WHOLE && !self.shows_all());
        more.for_each(|(code, count)| {
            self.err(&format!("{} more [{code}]; use -v to list them", count - SHOWN_WHOLE));
        });
    }

    fn is_json(&self) -> bool {
        self.form == LogFormat::Json
    }

    fn shows_all(&self) -> bool {
        self.is_verbose() || self.is_json()
    }

    /// Reports why a command failed and returns its exit code.
    pub(crate) fn failure(&self, failure: &Failure) -> Code {
        match failure {
            Failure::Refused(diagnostics) => {
                self.diagnostics(diagnostics);
                self.note("no changes were made");
            }
            Failure::Failed(diagnostic) => self.diagnostic(diagnostic),
            Failure::PipeClosed => {}
        }
        failure.code()
    }

    /// Writes to stderr; a closed stderr is ignored.
    #[expect(clippy::unused_self, reason = "only who holds the output may write")]
    fn err(&self, text: &str) {
        let _ = writeln!(io::stderr().lock(), "{text}");
    }
}

/// Escapes a name from a log or table, so that it cannot move the cursor, change colours or reverse other text.
pub(crate) fn escape(text: &str) -> String {
    escape_cell(text).into_owned()
}

fn coloured(text: &str) -> String {
    let (head, rest) = text.split_once(':').unwrap_or((text, ""));
    format!("\u{1b}[1;31m{head}\u{1b}[0m:{}", rest.replace("\nhint:", "\n\u{1b}[36mhint\u{1b}[0m:"))
}

/// Text with the first state mark of each line in colour.
fn with_coloured_states(text: &str) -> String {
    let style = || console::Style::new().force_styling(true);
    let marks =
        [("◆ act", style().red().bold()), ("▲ plan", style().yellow().bold()), ("● watch", style().cyan())];
    let coloured = |line: &str| {
        let found = marks.iter().find_map(|(mark, style)| Some((line.split_once(mark)?, mark, style)));
        match found {
            Some(((before, after), mark, style)) => format!("{before}{}{after}", style.apply_to(mark)),
            None => line.to_owned(),
        }
    };
    text.split_inclusive('\n').map(coloured).collect()
}
