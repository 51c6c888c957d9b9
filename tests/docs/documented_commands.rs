//! Every command that the README and the documentation show is run, and its output must match the page. Only the gate
//! tries every page.
//!
//! Each page starts in a copy of the sample fleet; its blocks of `sh` and `console` run one after the other.
//! Comments above a block change the defaults: `first: COMMAND` runs before it and is not shown, `exit 1` is the
//! expected exit code of its last command, `output` (above a block of `text`) marks the output of the block before,
//! and `not run: WHY` exempts a block. A line `…` replaces omitted lines; times, sizes and digests may differ.
//! `edit: ["FILE", "FROM", "TO"]` replaces text before its block, and `log: {…}` writes logs again before `first:`, with the
//! keys of [`LogRewrite`]. `needs: PROGRAM` leaves a block out on a machine without that program. `records` prints every stored record without what names the log, the settings and the run.
//! `FREEPLAY_TESTS=gate FREEPLAY_BLESS=1 cargo test -p cli documented_commands` writes the output into the pages, except
//! where lines are omitted.

use std::fs;
use std::ops::Range;
use std::process::{Command, Stdio};

use regex::Regex;

use crate::harness::{LogRewrite, TestFleet, spread, top};
use crate::markdown::{Block, Page, all};

/// The shell function `records`; its columns are those of a comparison of two runs.
const RECORDS: &str = r#"records() { freeplay store export --format csv "$@" | awk -F, '
    NR == 1 { for (i = 1; i <= NF; i++) left_out[i] = $i ~ /^(log_path|(log|config)_digest|run_id|processed_utc)$/ }
    { line = ""; for (i = 1; i <= NF; i++) if (!left_out[i]) line = line "," $i; print line }' | LC_ALL=C sort; }"#;

/// Pages that are tried outside the gate, README first.
const PAGES: usize = 3;

/// Blocks that are not run here: one needs a mail server, one simulates for a minute.
const EXEMPT: usize = 2;

#[test]
fn commands_in_the_pages_do_what_the_pages_say() {
    let pages: Vec<Page> = all().into_iter().filter(|page| page.blocks.iter().any(runs)).collect();
    let exempt: Vec<&Block> =
        pages.iter().flat_map(|p| &p.blocks).filter(|b| runs(b) && b.mark("not run:").is_some()).collect();
    assert_eq!(exempt.len(), EXEMPT, "blocks that are not run: {:?}", marks(&exempt));
    let pages: Vec<&Page> = pages.iter().collect();
    let faults: Vec<String> = std::thread::scope(|scope| {
        let tried: Vec<_> =
            spread(&pages, PAGES).into_iter().map(|page| scope.spawn(|| Try::of(page))).collect();
        tried.into_iter().flat_map(|page| page.join().unwrap()).collect()
    });
    assert!(faults.is_empty(), "{}", faults.join("\n\n"));
}

/// Runs each block of a page of `tests/data` in a copy of a fleet with two stored flights.
fn try_blocks(page: &str) -> Page {
    let sound = TestFleet::sample();
    sound.run_ok(&["run", "--tail", "N412FP", "--limit", "2"]);
    let page = Page::read(&top().join("tests/data").join(page));
    let try_some = |blocks: &[Block]| {
        let mut tried = Try::new(&page, sound.copied());
        for block in blocks {
            tried.fleet = sound.copied();
            tried.block(block, &mut String::new());
        }
        (tried.faults, tried.blessed)
    };
    let mut all = Try::new(&page, sound.copied());
    std::thread::scope(|scope| {
        let parts: Vec<_> = page
            .blocks
            .chunks(page.blocks.len().div_ceil(4))
            .map(|part| scope.spawn(|| try_some(part)))
            .collect();
        for part in parts {
            let (faults, blessed) = part.join().unwrap();
            all.faults.extend(faults);
            all.blessed.extend(blessed);
        }
    });
    all.bless();
    assert!(all.faults.is_empty(), "{}", all.faults.join("\n\n"));
    page
}

#[test]
fn commands_do_what_they_did_when_a_person_last_read_it() {
    try_blocks("commands.md");
}

#[test]
fn logs_of_any_shape_give_what_a_person_last_read() {
    try_blocks("logs.md");
}

#[test]
fn errors_read_as_they_were_last_read_by_a_person() {
    let page = try_blocks("errors.md");
    assert!(!page.text.contains("panicked") && !page.text.contains("os error 21"));
    let explained = fs::read_to_string(top().join("docs/errors.md")).unwrap();
    for code in Regex::new(r"error\[(\w+)\]").unwrap().captures_iter(&page.text) {
        assert!(explained.contains(&format!("`{}`", &code[1])), "{} is not in docs/errors.md", &code[1]);
    }
}

fn marks<'b>(blocks: &[&'b Block]) -> Vec<&'b str> {
    blocks.iter().filter_map(|block| block.mark("not run:")).collect()
}

/// Whether a block is run: each `console` block, and each `sh` block that calls Freeplay.
fn runs(block: &Block) -> bool {
    let ours = |line: &str| {
        ["freeplay ", "cargo run -- ", "cargo run --locked -- "].iter().any(|ours| line.starts_with(ours))
    };
    block.language == "console" || (block.language == "sh" && block.text.lines().any(ours))
}

fn is_there(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok()
}

struct Step {
    script: String,
    shown: Option<Range<usize>>,
    code: i32,
}

/// A page that is tried: its folder, and what was found wrong.
struct Try<'p> {
    page: &'p Page,
    fleet: TestFleet,
    faults: Vec<String>,
    /// Ranges of the page with their new text, for `FREEPLAY_BLESS`.
    blessed: Vec<(Range<usize>, String)>,
}

impl<'p> Try<'p> {
    fn of(page: &'p Page) -> Vec<String> {
        let mut tried = Self::new(page, TestFleet::sample_data());
        let mut output = String::new();
        page.blocks.iter().for_each(|block| tried.block(block, &mut output));
        tried.bless();
        tried.faults
    }

    fn new(page: &'p Page, fleet: TestFleet) -> Self {
        Self { page, fleet, faults: Vec::new(), blessed: Vec::new() }
    }

    /// Runs a block, or compares it with the output of the block before.
    fn block(&mut self, block: &Block, output: &mut String) {
        let mut needed = block.marks.iter().filter_map(|mark| mark.strip_prefix("needs: "));
        if !needed.all(is_there) {
            return;
        }
        for change in block.marks.iter().filter_map(|mark| mark.strip_prefix("edit: ")) {
            let [file, from, to]: [String; 3] = serde_json::from_str(change).unwrap();
            self.fleet.edit(&file, |text| text.replacen(&from, &to, 1));
        }
        for change in block.marks.iter().filter_map(|mark| mark.strip_prefix("log: ")) {
            self.fleet.rewrite_logs(&serde_json::from_str::<LogRewrite>(change).unwrap());
        }
        if let Some(command) = block.mark("first:") {
            self.run(&Step { script: command.to_owned(), shown: None, code: 0 });
        }
        if block.marks.iter().any(|mark| mark == "output") {
            self.compare(&block.span, output);
        } else if runs(block) && block.mark("not run:").is_none() {
            *output = steps(block).iter().map(|step| self.run(step)).collect();
        }
    }

    /// Runs a command in the shell, in the folder in which the last one ended.
    fn run(&mut self, step: &Step) -> String {
        let command =
            step.script.replace("cargo run --locked -- ", "freeplay ").replace("cargo run -- ", "freeplay ");
        let script = format!(
            "{RECORDS}\nexec 2>&1\ncd \"$(cat .here)\"\nset -e\ntrap 'code=$?; pwd > \"$TOP\"/.here; exit $code' EXIT\n{command}"
        );
        let folder = fs::canonicalize(self.fleet.path("")).unwrap();
        if !folder.join(".here").exists() {
            fs::write(folder.join(".here"), folder.to_str().unwrap()).unwrap();
        }
        let result = shell(&folder, &script).output().unwrap();
        let output =
            String::from_utf8_lossy(&result.stdout).replace(&*folder.to_string_lossy(), "/srv/fleet");
        let output: String =
            output.split_inclusive('\n').filter(|line| !line.contains(" % elapsed ")).collect();
        if result.status.code() != Some(step.code) {
            let (name, code) = (&self.page.name, result.status.code());
            self.faults
                .push(format!("{name}: `{}` ended with {code:?}, not {}:\n{output}", step.script, step.code));
        } else if let Some(span) = &step.shown {
            self.compare(span, &output);
        }
        output
    }

    fn compare(&mut self, span: &Range<usize>, output: &str) {
        let shown = &self.page.text[span.clone()];
        let output = trimmed(output);
        if fits(&masked(shown), &masked(&output)) {
            return;
        }
        if std::env::var_os("FREEPLAY_BLESS").is_some() && !shown.lines().any(|line| line == "…") {
            self.blessed.push((span.clone(), output));
        } else {
            self.faults.push(format!("{}: shown\n{shown}\noutput\n{output}", self.page.name));
        }
    }

    fn bless(&mut self) {
        if self.blessed.is_empty() {
            return;
        }
        let mut text = self.page.text.clone();
        self.blessed.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
        for (span, output) in &self.blessed {
            text.replace_range(span.clone(), output);
        }
        fs::write(top().join(&self.page.name), text).unwrap();
    }
}

/// A shell that finds the program, and no configuration that the environment names.
fn shell(folder: &std::path::Path, script: &str) -> Command {
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_freeplay")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    let mut shell = Command::new("sh");
    shell.args(["-c", script]).current_dir(folder).stdin(Stdio::null());
    shell.env("PATH", path).env("TOP", folder).env("DATA", top().join("tests/data"));
    shell.env_remove("FREEPLAY_CONFIG");
    shell
}

/// The commands of a block: a `sh` block is one script; in a `console` block, each line after `$ ` is a command.
fn steps(block: &Block) -> Vec<Step> {
    let code = block.mark("exit").map_or(0, |code| code.parse().unwrap());
    if block.language == "sh" {
        return vec![Step { script: block.text.clone(), shown: None, code }];
    }
    let mut steps: Vec<Step> = Vec::new();
    let mut at = block.span.start;
    for line in block.text.split_inclusive('\n') {
        let next = at + line.len();
        if let Some(command) = line.strip_prefix("$ ") {
            steps.push(Step { script: command.to_owned(), shown: Some(next..next), code: 0 });
        } else if let Some(step) = steps.last_mut() {
            match line.strip_prefix("> ") {
                Some(more) => {
                    step.script.push_str(more);
                    step.shown = Some(next..next);
                }
                None => step.shown = step.shown.as_ref().map(|shown| shown.start..next),
            }
        }
        at = next;
    }
    if let Some(last) = steps.last_mut() {
        last.code = code;
    }
    steps
}

fn trimmed(output: &str) -> String {
    output.lines().flat_map(|line| [line.trim_end(), "\n"]).collect()
}

/// Lines in which words replace times, sizes and digests, which differ between two runs of the same logs.
fn masked(text: &str) -> Vec<String> {
    const DIFFERS: &[(&str, &str)] = &[
        (r"\d{8}T\d{9}Z-[0-9a-f]{8}", "RUN"),
        (r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?(Z| UTC)", "TIME"),
        (r"\d+ min \d+ s|\d+(\.\d+)? m?s\b", "SPAN"),
        (r"\d+(\.\d+)? ([kM]i?B|bytes)\b", "SIZE"),
        (r"\b[0-9a-f]{12,}\b", "DIGEST"),
        (r"\d+ workers?", "WORKERS"),
        (r"newest log [^,]+, \d+ days? old", "AGE"),
        (r"slowest log +\S+ ", "slowest"),
        (r" +", " "),
    ];
    let differs: Vec<_> =
        DIFFERS.iter().map(|(differs, word)| (Regex::new(differs).unwrap(), *word)).collect();
    let line = |line: &str| {
        let cut =
            |text: String, (differs, word): &(Regex, &str)| differs.replace_all(&text, *word).into_owned();
        differs.iter().fold(line.trim().to_owned(), cut)
    };
    text.lines().map(line).collect()
}

/// Whether the shown lines match the output; `…` matches any lines.
fn fits(shown: &[String], output: &[String]) -> bool {
    let Some((first, rest)) = shown.split_first() else { return output.is_empty() };
    if first == "…" {
        return (0..=output.len()).any(|skipped| fits(rest, &output[skipped..]));
    }
    output.split_first().is_some_and(|(line, after)| line == first && fits(rest, after))
}
