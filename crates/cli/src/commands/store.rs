//! `store`: care of the results.

use store::{Query, Store};

use crate::args::{Format, Global, Output, StoreArgs, StoreCommand};
use crate::exit::{Code, Failure};
use crate::rows;
use crate::talk::Talk;

use super::{config, query};

/// Cares for the store that the configuration names.
///
/// # Errors
/// When configuration or store cannot be read, or written.
pub(crate) fn store(args: &StoreArgs, global: &Global, talk: &Talk) -> Result<Code, Failure> {
    let store = Store::open(config(global)?.store())?;
    match &args.command {
        StoreCommand::Export { output } => export(&store, output, talk),
        StoreCommand::Info { .. } | StoreCommand::Verify | StoreCommand::Compact => Ok(Code::Well),
    }
}

fn export(store: &Store, output: &Output, talk: &Talk) -> Result<Code, Failure> {
    if output.format() == Format::Table {
        let records = store.records(&Query::default())?;
        rows::answer(output, talk, || Ok(store::columns::to_batch(&records)?), || query::page(&records))?;
    } else {
        let batch = store.scan(&Query::default())?;
        rows::answer(output, talk, || Ok(batch), String::new)?;
    }
    Ok(Code::Well)
}
