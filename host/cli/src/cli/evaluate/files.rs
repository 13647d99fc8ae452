//! Scores for other programs: CSV and JSON.

use serde_json::{Map, Value, json};
use viewfuse_evaluate::summary::Table;
use viewfuse_evaluate::{PSNR, SSIM, Score};

/// A score, with what stands before it on its line.
pub(super) type Line<'a> = (Vec<String>, &'a Score);

/// What a table of scenes begins with.
pub(super) const CSV_BEGINNING: &str = "scene,scheme,target,sources,";

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

/// A table with its title and its sentences. What is no finite number is null.
pub(super) fn json_of(title: &str, table: &Table) -> anyhow::Result<Value> {
    let mut whole = Map::from_iter([("title".to_owned(), json!(title))]);
    if let Value::Object(table) = serde_json::to_value(table)? {
        whole.extend(table);
    }
    whole.insert("intervals".to_owned(), json!(table.interval_words()));
    whole.insert("verdicts".to_owned(), json!(table.verdicts()));
    whole.insert("details".to_owned(), json!(table.details()));
    Ok(Value::Object(whole))
}
