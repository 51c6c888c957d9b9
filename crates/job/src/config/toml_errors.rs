//! Errors of the TOML parser, in terms of the file instead of the program.

use ingest::mapping::column_pattern::nearest;
use records::Diagnostic;

/// The reader's message as a diagnostic; one that is not known is handed on as it is.
pub(super) fn diagnostic(message: &str) -> Diagnostic {
    let message = message.trim();
    let known = unknown_value(message).or_else(|| missing_key(message)).or_else(|| other_type(message));
    known.unwrap_or_else(|| {
        let diagnostic = Diagnostic::new("bad_toml", message);
        if message == "duplicate key" { diagnostic.hint("remove one of the two lines") } else { diagnostic }
    })
}

fn unknown_value(message: &str) -> Option<Diagnostic> {
    let (found, wanted) = message.strip_prefix("unknown variant `")?.split_once("`, expected ")?;
    let wanted = wanted.trim_start_matches("one of ");
    let near = nearest(found, wanted.split('`').skip(1).step_by(2));
    let near = near.map(|near| format!("`{near}`? ")).unwrap_or_default();
    let diagnostic = Diagnostic::new("bad_toml", format!("unknown value or key `{found}`"));
    Some(diagnostic.hint(format!("{near}It can be {wanted}")))
}

fn missing_key(message: &str) -> Option<Diagnostic> {
    let key = message.strip_prefix("missing field `")?.strip_suffix('`')?;
    let hint = match key {
        "logs" => {
            "add a table `[logs]`, or write a complete configuration with `freeplay init DIR`".to_owned()
        }
        "motor_position" | "screw_position" | "load" => {
            format!("add a table `[channel.{key}]` with its `column` and `unit`")
        }
        _ => format!("add a line `{key} = …` here"),
    };
    Some(Diagnostic::new("bad_toml", format!("`{key}` is missing")).hint(hint))
}

fn other_type(message: &str) -> Option<Diagnostic> {
    let (found, wanted) = message.strip_prefix("invalid type: ")?.split_once(", expected ")?;
    let (wanted, hint) = match wanted {
        "f64" => ("a number", Some("a plain number such as `8.0`; its unit is in the key's name")),
        "a string" => ("text", Some("put text in quotes: `\"…\"`")),
        "a sequence" => ("a list", Some("write a list in brackets: `[\"…\"]`")),
        "struct AlertChannel" => ("a table", Some("name each channel: `[alerts.mail]`")),
        other => (other, None),
    };
    let is_single = matches!(wanted, "a number" | "text");
    let hint =
        if is_single && found == "map" { Some("write a table in single brackets: `[name]`") } else { hint };
    let diagnostic = Diagnostic::new("bad_toml", format!("expected {wanted}, found {found}"));
    Some(Diagnostic { hint: hint.map(str::to_owned), ..diagnostic })
}
