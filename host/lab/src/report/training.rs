//! A folder of `train` on the page: its `record.json` and `curve.svg`, as far as they exist.

use super::{ReportError, data_address, read, table};
use maud::{Markup, html};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A training that is finished or under way.
#[derive(Clone, Debug)]
pub struct Training {
    folder: PathBuf,
    record: Option<Value>,
    curve: Option<Vec<u8>>,
}

impl Training {
    /// Reads a folder, which must hold at least one of the two files.
    pub fn open(folder: &Path) -> Result<Training, ReportError> {
        let [record, curve] = ["record.json", "curve.svg"].map(|name| folder.join(name));
        let parsed = |path: &Path| {
            let bytes = read(path)?;
            let json = serde_json::from_slice(&bytes);
            json.map_err(|cause| ReportError::Json { path: path.to_path_buf(), command: "train", cause })
        };
        // If neither exists, the message names the record.
        let record = if record.is_file() || !curve.is_file() { Some(parsed(&record)?) } else { None };
        let drawn = |path: &Path| match read(path) {
            // A link to something else must not become a part of the page.
            Ok(bytes) if bytes.is_empty() || bytes.starts_with(b"<svg") => Ok(bytes),
            Ok(_) => Err(ReportError::NoCurve { path: path.to_path_buf() }),
            Err(error) => Err(error),
        };
        let curve = if curve.is_file() { Some(drawn(&curve)?) } else { None };
        Ok(Training { folder: folder.to_path_buf(), record, curve })
    }

    /// Its heading.
    pub(super) fn title(&self) -> String {
        let name = self.folder.file_name().map_or_else(String::new, |name| format!(": {}", name.to_string_lossy()));
        format!("Training{name}")
    }

    /// How far a run is that has not come to its end.
    fn unfinished(&self) -> Option<String> {
        let steps = |key: &str| self.record.as_ref()?.get(key)?.as_u64();
        let (done, planned) = (steps("steps")?, steps("steps_planned")?);
        (done < planned).then(|| format!("{done} of {planned} steps"))
    }

    pub(super) fn section(&self, id: &str) -> Markup {
        let rows = self.record.iter().flat_map(|record| flat("", record)).collect::<Vec<_>>();
        html! {
            section id=(id) {
                h2 { (self.title()) }
                @if let Some(done) = self.unfinished() { p.warning { strong { "Not finished: " } (done) } }
                @if let Some(curve) = &self.curve {
                    figure.wide { div.scroll {
                        img.paper src=(data_address("image/svg+xml", curve)) alt="loss and validation over the steps";
                    } }
                }
                (table::record("Training record", &rows))
            }
        }
    }
}

/// Single values by name; a list is shown as its length and its last item.
fn flat(name: &str, value: &Value) -> Vec<(String, String)> {
    let below = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    match value {
        Value::Object(all) => all.iter().flat_map(|(key, value)| flat(&below(key), value)).collect(),
        Value::Array(items) if items.len() > 8 || items.iter().any(Value::is_array) => {
            let last = items.last().map_or_else(String::new, Value::to_string);
            vec![(name.to_owned(), format!("{} entries, the last {last}", items.len()))]
        }
        Value::String(text) => vec![(name.to_owned(), text.clone())],
        value => vec![(name.to_owned(), value.to_string())],
    }
}
