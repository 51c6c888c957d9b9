//! The accuracy study: flights of known gap, the methods compared, and how far each is from the truth.
//!
//! [`scenarios::CLASSES`] lists classes of flights, each with one assumption of the estimator broken;
//! `scenarios::Class::case` draws a flight from a class and an index.
//!
//! `simulator` shares no equation with `estimator`, so neither can flatter the other.

pub mod accuracy_page;
mod drawing;
pub mod gear_bench;
pub mod methods;
pub mod metrics;
pub mod paper;
pub mod plots;
pub mod robot_logs;
pub mod scenarios;

/// A template with its places `{{NAME}}` filled.
pub(crate) fn fill(template: &str, values: &[(&str, String)]) -> String {
    values
        .iter()
        .fold(template.to_owned(), |text, (name, value)| text.replace(&format!("{{{{{name}}}}}"), value))
}
