//! Tables of results and of records.

use super::counted;
use maud::{Markup, html};
use viewfuse_evaluate::metrics::interval::Interval;
use viewfuse_evaluate::summary::{Cell, Column, Metric, REFERENCE, Table};

/// A table of results as papers print it.
pub(super) fn results(table: &Table) -> Markup {
    let columns = table.columns();
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
                        @for column in &columns {
                            @if let Column::Value(metric) = column {
                                th scope="col" {
                                    (table.heading(*column)) " "
                                    (if table.metrics[*metric].larger_is_better { "↑" } else { "↓" })
                                }
                            } @else {
                                th.versus scope="col" { (table.heading(*column)) }
                            }
                        }
                        th scope="col" { "s / view" }
                    }
                }
                tbody {
                    @for row in &table.rows {
                        tr class=(if row.is_baseline { "copy" } else { "" }) {
                            th scope="row" { (row.scheme) }
                            @for column in &columns {
                                @let metric = column.metric(table);
                                @let cell = row.cells[metric].as_ref();
                                @if let Column::Value(_) = column {
                                    (value(cell, &table.metrics[metric]))
                                } @else {
                                    (versus(column.difference(cell), &table.metrics[metric]))
                                }
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
    let Some(Cell { value, leads, place, .. }) = cell else { return html! { td {} } };
    let mean = metric.text(value.mean);
    html! {
        td {
            @if *leads && *place == 1 { b { (mean) } } @else if *leads { i { (mean) } } @else { (mean) }
            (half_width(value, metric))
        }
    }
}

fn versus(difference: Option<Interval>, metric: &Metric) -> Markup {
    let Some(versus) = difference else { return html! { td.versus {} } };
    let better = (versus.mean > 0.0) == metric.larger_is_better;
    let class = match (versus.excludes_zero(), better) {
        (false, _) => "versus",
        (true, true) => "versus gain",
        (true, false) => "versus loss",
    };
    let decimals = metric.decimals;
    html! { td class=(class) { (format!("{:+.decimals$}", versus.mean)) (half_width(&versus, metric)) } }
}

fn half_width(interval: &Interval, metric: &Metric) -> Markup {
    html! { @if let Some(half) = interval.half_width { span.half { " ± " (metric.text(half)) } } }
}

/// How to read tables of results.
pub(super) fn legend() -> Markup {
    html! {
        p.legend {
            b { "Bold" } ": the best of its column; " i { "italic" } ": not shown to differ from the best, by the \
                interval of their difference; neither where that is "
            "every row. Means are over scenes, or over the views of one, with 95 % intervals (Student). Differences \
                from the nearest copy and from " code { (REFERENCE) } " are taken scene by scene, or view by view; "
            span.gain { "coloured" } " where the interval leaves out zero."
        }
    }
}

/// A record, collapsed.
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
