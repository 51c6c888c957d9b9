//! The pages that people read, taken apart: headings, links and blocks of code, by a Markdown parser.

use std::ops::Range;
use std::path::{Path, PathBuf};

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

use crate::harness::top;

pub(crate) struct Page {
    /// From the top of the repository.
    pub(crate) name: String,
    pub(crate) text: String,
    /// What a link may name after its `#`.
    pub(crate) anchors: Vec<String>,
    /// Where links and pictures lead, as written.
    pub(crate) links: Vec<String>,
    pub(crate) blocks: Vec<Block>,
}

pub(crate) struct Block {
    /// What stands behind the fence: `sh`, `console`, `toml`.
    pub(crate) language: String,
    /// Byte range of its text in the page.
    pub(crate) span: Range<usize>,
    pub(crate) text: String,
    /// The comments right above it, such as `not run: needs systemd`.
    pub(crate) marks: Vec<String>,
}

impl Block {
    pub(crate) fn mark(&self, name: &str) -> Option<&str> {
        self.marks.iter().find_map(|mark| mark.strip_prefix(name)).map(str::trim)
    }
}

impl Page {
    pub(crate) fn read(file: &Path) -> Self {
        let text = std::fs::read_to_string(file).unwrap();
        let name = file.strip_prefix(top()).unwrap().to_string_lossy().replace('\\', "/");
        let mut page =
            Self { name, anchors: Vec::new(), links: Vec::new(), blocks: Vec::new(), text: String::new() };
        page.take(&text);
        page.text = text;
        page
    }

    fn take(&mut self, text: &str) {
        let mut heading: Option<String> = None;
        let mut marks = Vec::new();
        let mut block: Option<Block> = None;
        let parser = Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter();
        for (event, span) in parser {
            match event {
                Event::Html(html) => marks.extend(comment(&html)),
                Event::Start(Tag::HtmlBlock) | Event::End(TagEnd::HtmlBlock) => {}
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(language))) => {
                    let marks = std::mem::take(&mut marks);
                    let span = span.end..span.end;
                    block = Some(Block { language: language.to_string(), span, text: String::new(), marks });
                }
                Event::End(TagEnd::CodeBlock) => self.blocks.extend(block.take()),
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => self.anchors.extend(heading.take().map(|h| anchor(&h))),
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    self.links.push(dest_url.to_string());
                }
                Event::Text(words) | Event::Code(words) => {
                    if let Some(block) = &mut block {
                        block.span = block.span.start.min(span.start)..span.end;
                        block.text.push_str(&words);
                    } else if let Some(heading) = &mut heading {
                        heading.push_str(&words);
                    }
                }
                _ => marks.clear(),
            }
        }
    }
}

fn comment(html: &str) -> Option<String> {
    Some(html.trim().strip_prefix("<!--")?.strip_suffix("-->")?.trim().to_owned())
}

/// The name of a heading in a link, as GitHub and mdBook make it.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.collect::<String>().trim().to_lowercase().replace(' ', "-")
}

/// The README, the pages at the top, and every page of the book.
pub(crate) fn all() -> Vec<Page> {
    let names = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"];
    let mut files: Vec<PathBuf> = names.iter().map(|name| top().join(name)).collect();
    let pattern = top().join("docs/**/*.md");
    let mut book: Vec<PathBuf> = glob::glob(pattern.to_str().unwrap()).unwrap().flatten().collect();
    book.sort();
    files.extend(book);
    files.iter().map(|file| Page::read(file)).collect()
}
