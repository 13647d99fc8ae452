//! What an evaluation prints, and its CSV file.

use crate::cli::say;
use crate::cli::table::table;
use std::io;
use viewfuse_evaluate::summary::{Cell, Metric, REFERENCE, Row, Table};
use viewfuse_evaluate::{Mean, NEAREST_COPY, PSNR, SSIM, Score};

/// Means over the targets; the best value of each column is marked.
pub(super) fn print_means(title: &str, means: &[Mean]) -> io::Result<()> {
    let copy = means.iter().find(|mean| mean.scheme == NEAREST_COPY).map_or(f64::NAN, |mean| mean.psnr);
    let best_psnr = means.iter().map(|mean| mean.psnr).fold(f64::NEG_INFINITY, f64::max);
    let best_ssim = means.iter().filter_map(|mean| mean.ssim).fold(f64::NEG_INFINITY, f64::max);
    let further: Vec<Metric> =
        means.first().iter().flat_map(|mean| &mean.further).map(|(name, _)| Metric::named(name)).collect();
    let mut header = ["scheme", "PSNR dB", "over copy", "SSIM"].map(str::to_owned).to_vec();
    header.extend(further.iter().map(Metric::heading));
    header.push("s / view".to_owned());
    let mut rows = table(header);
    let marked = |text: String, is_best: bool| if is_best { format!("* {text}") } else { text };
    for mean in means {
        let is_copy = mean.scheme == NEAREST_COPY;
        let value = |mean: &Mean, metric: &Metric| {
            mean.further.iter().find(|(name, _)| *name == metric.name).map(|(_, value)| *value)
        };
        let least = |metric: &Metric| means.iter().filter_map(|mean| value(mean, metric)).fold(f64::INFINITY, f64::min);
        let mut row = vec![
            mean.scheme.clone(),
            marked(format!("{:.2}", mean.psnr), mean.psnr == best_psnr),
            if is_copy { String::new() } else { format!("{:+.2}", mean.psnr - copy) },
            mean.ssim.map_or(String::new(), |ssim| marked(format!("{ssim:.3}"), ssim == best_ssim)),
        ];
        // Distances: less is better.
        row.extend(further.iter().map(|metric| {
            value(mean, metric).map_or(String::new(), |own| marked(metric.text(own), own == least(metric)))
        }));
        row.push(if is_copy { String::new() } else { format!("{:.2}", mean.seconds) });
        rows.add_row(row);
    }
    let count = means.first().map_or(0, |mean| mean.target_count);
    say(format_args!("{title}: {}", if count == 1 { "1 target".to_owned() } else { format!("{count} targets") }))?;
    say(format_args!("{rows}\n"))
}

/// A table with intervals; the best of each column is marked.
pub(super) fn print_table(title: &str, results: &Table) -> io::Result<()> {
    let has_reference = results.rows.iter().any(|row| row.scheme == REFERENCE);
    let mut header = vec!["scheme".to_owned()];
    for metric in &results.metrics {
        header.push(metric.heading());
        header.extend(has_reference.then(|| format!("over {REFERENCE}")));
    }
    header.push("s / view".to_owned());
    let mut rows = table(header);
    for row in &results.rows {
        rows.add_row(line(row, &results.metrics, has_reference));
    }
    let counted = |count: usize, what: &str| if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") };
    let sources: Vec<String> = results.source_counts.iter().map(usize::to_string).collect();
    let (scenes, pictures) = (counted(results.scene_count, "scene"), counted(results.target_count, "picture"));
    say(format_args!("{title}, sources: {}; {scenes}, {pictures} of each scheme", sources.join(", ")))?;
    say(format_args!("{rows}\n"))
}

fn line(row: &Row, metrics: &[Metric], has_reference: bool) -> Vec<String> {
    let mut line = vec![row.scheme.clone()];
    for (cell, metric) in row.cells.iter().zip(metrics) {
        let value = cell.as_ref().map(|Cell { value, place, .. }| {
            format!("{}{}", if *place == 1 { "* " } else { "" }, metric.interval_text(value, false))
        });
        line.push(value.unwrap_or_default());
        if has_reference {
            let versus = cell.as_ref().and_then(|cell| cell.versus_reference.as_ref());
            line.push(versus.map_or(String::new(), |versus| metric.interval_text(versus, true)));
        }
    }
    line.push(row.seconds.map_or(String::new(), |seconds| format!("{seconds:.3}")));
    line
}

/// A score, with the first columns of its line.
pub(super) type Line<'a> = (Vec<String>, &'a Score);

/// Every score, a line each, behind columns of other names. A metric that a picture lacks is empty.
pub(super) fn csv_of(first_columns: &[&str], lines: &[Line<'_>]) -> anyhow::Result<Vec<u8>> {
    let mut metrics: Vec<&str> = vec![PSNR, SSIM];
    for (name, _) in lines.iter().flat_map(|(_, score)| &score.values) {
        if !metrics.contains(&name.as_str()) {
            metrics.push(name);
        }
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    let titles: Vec<&str> = metrics.iter().map(|name| if *name == PSNR { "psnr_db" } else { name }).collect();
    let header = first_columns.iter().chain(&["scheme", "target", "sources"]).chain(&titles).chain(&["seconds"]);
    writer.write_record(header)?;
    for (first, score) in lines {
        let mut line = first.clone();
        line.extend([score.scheme.clone(), score.target.clone(), score.source_count.to_string()]);
        line.extend(metrics.iter().map(|name| score.value(name).map_or(String::new(), |value| format!("{value:.6}"))));
        line.push(format!("{:.6}", score.time.as_secs_f64()));
        writer.write_record(line)?;
    }
    Ok(writer.into_inner()?)
}
