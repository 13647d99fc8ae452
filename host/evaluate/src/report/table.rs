//! Tables of results and of records.

use super::counted;
use crate::metrics::interval::Interval;
use crate::summary::{Cell, Metric, REFERENCE, Table};
use maud::{Markup, html};

/// A table of results as papers print it.
pub(super) fn results(table: &Table) -> Markup {
    let has_reference = table.rows.iter().any(|row| row.scheme == REFERENCE);
    let sources: Vec<String> = table.source_counts.iter().map(usize::to_string).collect();
    html! {
        figure.table {
            figcaption {
                strong { (sources.join(", ")) " sources" } " "
                (counted(table.scene_count, "scene")) ", " (counted(table.target_count, "picture")) " of each scheme"
            }
            div.scroll { table.results {
                thead {
                    tr {
                        th scope="col" { "weighting" }
                        @for metric in &table.metrics {
                            th scope="col" { (metric.heading()) " " (if metric.larger_is_better { "↑" } else { "↓" }) }
                            @if has_reference { th.versus scope="col" { "over " (REFERENCE) } }
                        }
                        th scope="col" { "s / view" }
                    }
                }
                tbody {
                    @for row in &table.rows {
                        tr class=(if row.is_baseline { "copy" } else { "" }) {
                            th scope="row" { (row.scheme) }
                            @for (cell, metric) in row.cells.iter().zip(&table.metrics) {
                                (value(cell.as_ref(), metric))
                                @if has_reference { (versus(cell.as_ref(), metric)) }
                            }
                            td { @if let Some(seconds) = row.seconds { (format!("{seconds:.3}")) } }
                        }
                    }
                }
            } }
        }
    }
}

fn value(cell: Option<&Cell>, metric: &Metric) -> Markup {
    let Some(Cell { value, place, .. }) = cell else { return html! { td {} } };
    let mean = metric.text(value.mean);
    html! {
        td {
            @match place {
                1 => b { (mean) },
                2 => u { (mean) },
                _ => (mean),
            }
            (half_width(value, metric))
        }
    }
}

fn versus(cell: Option<&Cell>, metric: &Metric) -> Markup {
    let Some(versus) = cell.and_then(|cell| cell.versus_reference.as_ref()) else { return html! { td.versus {} } };
    let better = (versus.mean > 0.0) == metric.larger_is_better;
    let class = match (versus.excludes_zero(), better) {
        (false, _) => "versus",
        (true, true) => "versus gain",
        (true, false) => "versus loss",
    };
    let decimals = metric.decimals;
    html! { td class=(class) { (format!("{:+.decimals$}", versus.mean)) (half_width(versus, metric)) } }
}

fn half_width(interval: &Interval, metric: &Metric) -> Markup {
    html! { @if let Some(half) = interval.half_width { span.half { " ± " (metric.text(half)) } } }
}

/// How to read tables of results.
pub(super) fn legend() -> Markup {
    html! {
        p.legend {
            "The best value of a column is " b { "bold" } ", the next " u { "underlined" } ". Means are over scenes, or over the views of "
            "one, with 95 % intervals (Student). Differences from " code { (REFERENCE) } " are taken scene by scene, or view by view; "
            span.gain { "coloured" } " where the interval leaves out zero."
        }
    }
}

/// A record, folded in.
pub(super) fn record(title: &str, rows: &[(String, String)]) -> Markup {
    html! {
        details {
            summary { (title) }
            div.scroll {
                table.record {
                    @for (name, value) in rows { tr { th scope="row" { (name) } td { (value) } } }
                }
            }
        }
    }
}
