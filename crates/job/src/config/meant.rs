//! What the TOML reader complains of, in words of the file and not of the program.

use fleet::Complaint;
use ingest::pattern::nearest;

/// The reader's message as a complaint; one that is not known is handed on as it is.
pub(super) fn complaint(message: &str) -> Complaint {
    let message = message.trim();
    unknown_value(message).or_else(|| missing_key(message)).or_else(|| other_type(message)).unwrap_or_else(
        || {
            let complaint = Complaint::new("bad_toml", message);
            if message == "duplicate key" { complaint.hint("leave one of the two lines") } else { complaint }
        },
    )
}

fn unknown_value(message: &str) -> Option<Complaint> {
    let (found, wanted) = message.strip_prefix("unknown variant `")?.split_once("`, expected ")?;
    let wanted = wanted.trim_start_matches("one of ");
    let near = nearest(found, wanted.split('`').skip(1).step_by(2));
    let near = near.map(|near| format!("`{near}`? ")).unwrap_or_default();
    Some(
        Complaint::new("bad_toml", format!("`{found}` is not known here"))
            .hint(format!("{near}It can be {wanted}")),
    )
}

fn missing_key(message: &str) -> Option<Complaint> {
    let key = message.strip_prefix("missing field `")?.strip_suffix('`')?;
    Some(
        Complaint::new("bad_toml", format!("`{key}` is not given"))
            .hint(format!("add a line `{key} = …` here")),
    )
}

fn other_type(message: &str) -> Option<Complaint> {
    let (found, wanted) = message.strip_prefix("invalid type: ")?.split_once(", expected ")?;
    let (wanted, hint) = match wanted {
        "f64" => ("a number", Some("a plain number such as `8.0`; its unit is in the key's name")),
        "a string" => ("text", Some("text stands in quotes: `\"…\"`")),
        "a sequence" => ("a list", Some("a list stands in brackets: `[\"…\"]`")),
        other => (other, None),
    };
    let complaint = Complaint::new("bad_toml", format!("{found} stands where {wanted} is wanted"));
    Some(match hint {
        Some(hint) => complaint.hint(hint),
        None => complaint,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sentences are the TOML reader's own: were they to change, only the wording would fall back.
    #[test]
    fn the_readers_sentences_are_put_in_words_of_the_file() {
        let unit = complaint("unknown variant `degre`, expected one of `m`, `deg`, `rad`");
        assert_eq!(unit.what, "`degre` is not known here");
        assert_eq!(unit.hint.as_deref(), Some("`deg`? It can be `m`, `deg`, `rad`"));
        let number = complaint("invalid type: string \"8 kg\", expected f64");
        assert_eq!(number.what, "string \"8 kg\" stands where a number is wanted");
        assert_eq!(complaint("missing field `files`").what, "`files` is not given");
        assert_eq!(complaint("something else").what, "something else");
    }
}
