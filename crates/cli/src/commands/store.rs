//! `store`: care of the results.

use std::time::Duration;

use fleet::Complaint;
use store::{Holder, Query, Store};

use crate::args::{Global, Output, StoreArgs, StoreCommand};
use crate::exit::{Code, Failure};
use crate::progress::span;
use crate::rows;
use crate::talk::Talk;

use super::{config, query, run::count, shown};

/// Cares for the store that the configuration names.
///
/// # Errors
/// When configuration or store cannot be read, or written.
pub fn store(args: &StoreArgs, global: &Global, talk: &Talk) -> Result<Code, Failure> {
    let folder = config(global)?.store();
    let store = Store::open(&folder)?;
    match &args.command {
        StoreCommand::Info { max_age, json } => info(&store, &shown(&folder), *max_age, *json, talk),
        StoreCommand::Verify => verify(&store, talk),
        StoreCommand::Compact => {
            let files = store.lock(&Holder::this_process(), None)?.compact()?;
            talk.answer(&format!("merged {} into {}\n", count(files.before, "file"), files.after))?;
            Ok(Code::Well)
        }
        StoreCommand::Export { output } => export(&store, output, talk),
    }
}

fn export(store: &Store, output: &Output, talk: &Talk) -> Result<Code, Failure> {
    let records = store.records(&Query::default())?;
    rows::answer(output, talk, || Ok(store::columns::to_batch(&records)?), || query::page(&records))?;
    Ok(Code::Well)
}
