//! Progress of a long command: a bar on a terminal, a line now and then without one, nothing with `--quiet`.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use pipeline::Event;

use crate::output::{Output, escape, is_attended};

/// Minimum interval between progress lines without a terminal.
const SPARSE: Duration = Duration::from_secs(30);

/// Shows the progress of some work by its events, until it is done.
pub(crate) fn shown<T>(
    name: &'static str,
    output: &Output,
    work: impl FnOnce(&(dyn Fn(Event) + Sync)) -> T,
) -> T {
    let progress = Progress::new(name, output);
    let done = work(&|event| progress.follow(&event));
    progress.end();
    done
}

pub(crate) struct Progress<'t> {
    name: &'static str,
    output: &'t Output,
    bar: ProgressBar,
    terminal: bool,
    state: Mutex<State>,
}

/// What the bar itself does not count.
#[derive(Default)]
struct State {
    refused: usize,
    errors: usize,
    reported_at: Option<Instant>,
    in_progress: BTreeSet<String>,
}

impl<'t> Progress<'t> {
    /// Starts hidden, until the number of items is known.
    pub(crate) fn new(name: &'static str, output: &'t Output) -> Self {
        let terminal = is_attended();
        let target = if output.shows_progress() && terminal {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(None, target);
        Self { name, output, bar, terminal, state: Mutex::default() }
    }

    pub(crate) fn follow(&self, event: &Event) {
        match event {
            Event::Planned { logs, .. } => self.begin(*logs),
            Event::Started { log } => self.show(|state| {
                state.in_progress.insert(log.clone());
            }),
            Event::Finished { log, refused, diagnostics, .. } => {
                self.show(|state| {
                    state.in_progress.remove(log);
                    state.refused += refused;
                    state.errors += usize::from(!diagnostics.is_empty());
                });
                self.bar.inc(1);
                self.print_line();
            }
            Event::Stored { .. } | Event::Trends { .. } => {}
        }
    }

    fn begin(&self, logs: usize) {
        self.bar.reset_elapsed();
        self.bar.set_length(logs as u64);
        let template = "{prefix} {bar:24} {pos}/{len}  {rate:>10}  left {eta}  {wide_msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            let rate = |state: &ProgressState, out: &mut dyn Write| {
                let _ = write!(out, "{:.1}/min", 60.0 * state.per_sec());
            };
            self.bar.set_style(style.with_key("rate", rate).progress_chars("━╸─"));
        }
        self.bar.set_prefix(self.name);
        self.bar.enable_steady_tick(Duration::from_millis(200));
    }

    /// Changes the state and shows its failed logs, and a log in progress.
    fn show(&self, change: impl FnOnce(&mut State)) {
        let message = self.update(|state| {
            change(state);
            let log = state.in_progress.first().map(|path| path.rsplit('/').next().unwrap_or(path));
            format!("errors {}  {}", state.errors, escape(log.unwrap_or_default()))
        });
        self.bar.set_message(message);
    }

    pub(crate) fn end(&self) {
        self.bar.finish_and_clear();
    }

    fn update<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        // A panic in another thread must not stop the progress display: the numbers are still right.
        change(&mut self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    /// Prints a plain progress line: the first at once, then every 30 s.
    fn print_line(&self) {
        if self.terminal || !self.output.shows_progress() {
            return;
        }
        let line = self.update(|state| {
            let due = state.reported_at.is_none_or(|reported_at| reported_at.elapsed() >= SPARSE);
            due.then(|| {
                state.reported_at = Some(Instant::now());
                self.line(state)
            })
        });
        line.into_iter().for_each(|line| self.output.note(&line));
    }

    fn line(&self, state: &State) -> String {
        let (total, done) = (self.bar.length().unwrap_or_default(), self.bar.position());
        let elapsed = self.bar.elapsed();
        let left = elapsed.mul_f64(total.saturating_sub(done) as f64 / done.max(1) as f64);
        let percent = 100 * done / total.max(1);
        let now = jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ");
        format!(
            "{now} {} {done}/{total} {percent} % elapsed {} left {} refused {} errors {}",
            self.name,
            span(elapsed),
            span(left),
            state.refused,
            state.errors
        )
    }
}

pub(crate) fn span(span: Duration) -> String {
    match span.as_secs() {
        0 => format!("{:.1} s", span.as_secs_f64()),
        s @ 1..60 => format!("{s} s"),
        s @ 60..3600 => format!("{} min {} s", s / 60, s % 60),
        s => format!("{} h {} min", s / 3600, s / 60 % 60),
    }
}
