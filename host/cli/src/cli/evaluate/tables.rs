//! Tables of an evaluation on the terminal.

use crate::cli::printing::say;
use crate::cli::table::table;
use std::io;
use viewfuse_evaluate::protocol::Published;
use viewfuse_evaluate::summary::{Cell, Column, Row, Table};

/// Verdicts that are printed; of more, how many there are.
const VERDICTS: usize = 16;

/// A table with intervals under a title, and what it says in words, on request with the differences. The best row of
/// each column is marked, and those that are not shown to differ from it.
pub(super) fn print_table(title: &str, results: &Table, is_verbose: bool) -> io::Result<()> {
    let columns = results.columns();
    let headings = columns.iter().map(|column| results.heading(*column));
    let mut rows = table(["scheme".to_owned()].into_iter().chain(headings).chain(["s / view".to_owned()]));
    for row in &results.rows {
        let cells = columns.iter().map(|column| cell(row, results, *column));
        let seconds = row.seconds.map_or(String::new(), |seconds| format!("{seconds:.3}"));
        rows.add_row([row.scheme.clone()].into_iter().chain(cells).chain([seconds]));
    }
    say(title)?;
    say(rows)?;
    say(results.interval_words())?;
    if results.rows.iter().flat_map(|row| row.cells.iter().flatten()).any(|cell| cell.leads) {
        say("*: best of its column; ~: not shown to differ from the best")?;
    } else if results.target_count > 1 {
        say("no row is shown to be best")?;
    }
    let verdicts = if is_verbose { results.details() } else { results.verdicts() };
    verdicts.iter().take(VERDICTS).try_for_each(say)?;
    if verdicts.len() > VERDICTS {
        say(format_args!("and {} more", verdicts.len() - VERDICTS))?;
    }
    say("")
}

fn cell(row: &Row, results: &Table, column: Column) -> String {
    let metric = &results.metrics[column.metric(results)];
    let cell = row.cells[column.metric(results)].as_ref();
    if let Column::Value(_) = column {
        let mark = |cell: &Cell| match (cell.leads, cell.place) {
            (true, 1) => "* ",
            (true, _) => "~ ",
            (false, _) => "",
        };
        return cell
            .map_or(String::new(), |cell| format!("{}{}", mark(cell), metric.interval_text(&cell.value, false)));
    }
    column.difference(cell).map_or(String::new(), |difference| metric.interval_text(&difference, true))
}

/// What others published for the same protocol.
pub(super) fn print_published(published: &Published) -> io::Result<()> {
    if let Some(why) = &published.withheld {
        return say(format_args!("published figures are not shown: {why} ({})\n", published.of));
    }
    let mut rows = table(["published", "PSNR dB", "needs"].map(str::to_owned));
    for figure in &published.figures {
        rows.add_row([figure.method.to_owned(), format!("{:.2}", figure.psnr), figure.needs.to_owned()]);
    }
    say(format_args!("published for {}", published.of))?;
    say(format_args!("{rows}\n"))
}
