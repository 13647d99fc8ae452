//! Tables of an evaluation on the terminal.

use crate::cli::say;
use crate::cli::table::table;
use std::io;
use viewfuse_evaluate::baseline::Baseline;
use viewfuse_evaluate::metrics::interval::Interval;
use viewfuse_evaluate::protocol::Published;
use viewfuse_evaluate::summary::{Metric, REFERENCE, Row, Table};

/// Verdicts that are printed; of more, how many there are.
const VERDICTS: usize = 16;

/// `1 target`, `2 targets`.
pub(super) fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// A table with intervals under a title, and what it says in words. The leading rows of each column are marked.
pub(super) fn print_table(title: &str, results: &Table) -> io::Result<()> {
    let has = |scheme: &str| results.rows.iter().any(|row| row.scheme == scheme);
    let compared = Compared { copy: has(Baseline::NearestCopy.name()), reference: has(REFERENCE) };
    let mut header = vec!["scheme".to_owned()];
    for (column, metric) in results.metrics.iter().enumerate() {
        header.push(metric.heading());
        if column == results.headline {
            header.extend(compared.copy.then(|| "over copy".to_owned()));
            header.extend(compared.reference.then(|| format!("over {REFERENCE}")));
        }
    }
    header.push("s / view".to_owned());
    let mut rows = table(header);
    for row in &results.rows {
        rows.add_row(line(row, results, &compared));
    }
    say(title)?;
    say(rows)?;
    say(results.interval_words())?;
    if results.rows.iter().flat_map(|row| row.cells.iter().flatten()).any(|cell| cell.leads) {
        say("*: best of its column, or no difference from the best beyond the interval")?;
    } else if results.target_count > 1 {
        say("no row is best beyond the intervals")?;
    }
    let verdicts = results.verdicts();
    verdicts.iter().take(VERDICTS).try_for_each(say)?;
    if verdicts.len() > VERDICTS {
        say(format_args!("and {} more", verdicts.len() - VERDICTS))?;
    }
    say("")
}

/// Which rows the headline metric is compared with.
struct Compared {
    copy: bool,
    reference: bool,
}

fn line(row: &Row, results: &Table, compared: &Compared) -> Vec<String> {
    let mut line = vec![row.scheme.clone()];
    for (column, (cell, metric)) in row.cells.iter().zip(&results.metrics).enumerate() {
        let value = cell
            .as_ref()
            .map(|cell| format!("{}{}", if cell.leads { "* " } else { "" }, metric.interval_text(&cell.value, false)));
        line.push(value.unwrap_or_default());
        if column == results.headline {
            let versus = |wanted: bool, interval: Option<Interval>| wanted.then(|| text(interval, metric));
            line.extend(versus(compared.copy, cell.as_ref().and_then(|cell| cell.versus_copy)));
            line.extend(versus(compared.reference, cell.as_ref().and_then(|cell| cell.versus_reference)));
        }
    }
    line.push(row.seconds.map_or(String::new(), |seconds| format!("{seconds:.3}")));
    line
}

fn text(interval: Option<Interval>, metric: &Metric) -> String {
    interval.map_or(String::new(), |interval| metric.interval_text(&interval, true))
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
