//! A folder of `evaluate --protocol` on the page.

use super::{ReportError, counted, figure, pictures, table};
use maud::{Markup, PreEscaped, html};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use viewfuse_evaluate::gallery::{TargetPictures, shown};
use viewfuse_evaluate::protocol::{Benchmark, Protocol};
use viewfuse_evaluate::run_folder::{RunFolder, Settings, missing};
use viewfuse_evaluate::summary::{REFERENCE, Row, Table, tables};

/// An evaluation that is finished or under way.
#[derive(Clone, Debug)]
pub struct Evaluation {
    folder: PathBuf,
    settings: Settings,
    devices: BTreeSet<String>,
    missing: Vec<usize>,
    tables: Vec<Table>,
    shown: Vec<TargetPictures>,
}

impl Evaluation {
    /// Reads a folder.
    pub fn open(path: &Path) -> Result<Evaluation, ReportError> {
        let folder = RunFolder::open(path)?;
        let finished = folder.finished()?;
        let settings = folder.settings().clone();
        let by_count = settings.protocol.parse().is_ok_and(|protocol: Protocol| protocol.has_table_a_count());
        Ok(Evaluation {
            folder: path.to_path_buf(),
            devices: finished.values().map(|job| job.device.clone()).collect(),
            missing: missing(settings.job_count, &finished),
            tables: if finished.is_empty() { Vec::new() } else { tables(finished.values(), by_count) },
            shown: shown(path)?,
            settings,
        })
    }

    /// Its heading.
    pub(super) fn title(&self) -> &'static str {
        match self.settings.protocol.parse() {
            Ok(Protocol::Random { .. }) => "Random sources and targets",
            Ok(Protocol::Close { .. }) => "One source close to the target",
            Ok(Protocol::Count { .. }) => "Number of sources",
            Ok(Protocol::Fixed { .. }) => "Fixed views",
            Ok(Protocol::Nearest { .. }) => "Nearest sources",
            Ok(Protocol::Benchmark { benchmark: Benchmark::Llff, .. }) => "As on LLFF",
            Ok(Protocol::Benchmark { benchmark: Benchmark::Dtu, .. }) => "As on DTU",
            Ok(Protocol::Benchmark { benchmark: Benchmark::Blender, .. }) => "As on NeRF-synthetic",
            Err(_) => "Evaluation",
        }
    }

    /// Its heading in the contents, with its field and network.
    pub(super) fn entry(&self) -> String {
        format!("{}: {}", self.title(), self.field())
    }

    /// The field and its network, without that file's folder, which is in the record.
    fn field(&self) -> String {
        let Settings { field, options, .. } = &self.settings;
        let network = options.get("model").map(|model| model.rsplit(['/', '\\']).next().unwrap_or(model));
        network.map_or_else(|| field.clone(), |network| format!("{field} {network}"))
    }

    pub(super) fn section(&self, id: &str) -> Result<Markup, ReportError> {
        let Settings { protocol, job_count, notes, scenes, .. } = &self.settings;
        let done = job_count - self.missing.len();
        let figures = if self.tables.len() > 1 { figure::all(&self.tables)? } else { Vec::new() };
        Ok(html! {
            section id=(id) {
                h2 { (self.title()) }
                p.facts {
                    span { code { (protocol) } }
                    span { (counted(scenes.len(), "scene")) }
                    span { "field: " (self.field()) }
                    @for device in &self.devices { span { (device) } }
                }
                @if !self.missing.is_empty() {
                    p.warning {
                        strong { "Not finished: " } (done) " of " (counted(*job_count, "job")) "; the tables are of \
                            these. Missing: "
                        (named(&self.missing)) "."
                    }
                }
                @for lead in self.tables.iter().filter_map(lead) { (lead) }
                @for words in self.interval_words() { p.legend { (words) "." } }
                @if !figures.is_empty() {
                    div.figures { @for svg in &figures { figure { div.scroll.drawn { (PreEscaped(svg)) } } } }
                    (figure::key(&self.tables))
                }
                @for results in &self.tables { (table::results(results)) }
                @if !self.tables.is_empty() { (table::legend()) }
                @if !self.shown.is_empty() {
                    h3 { "Pictures" }
                    p.legend { "Bars are the weights of the sources, in their order, on one scale." }
                    p.legend { (pictures::error_legend()) }
                    @for shown in &self.shown { (pictures::comparison(&self.folder, shown)?) }
                }
                @if !notes.is_empty() {
                    details {
                        summary { "Notes" }
                        ul.notes { @for note in notes { li { (note) } } }
                    }
                }
                (self.record())
            }
        })
    }

    /// What the intervals of the tables are over: once where they say the same.
    fn interval_words(&self) -> Vec<String> {
        let mut words: Vec<String> = self.tables.iter().map(Table::interval_words).collect();
        words.dedup();
        words
    }

    fn record(&self) -> Markup {
        let Settings { viewfuse, schemes, options, files, scenes, job_count, .. } = &self.settings;
        let names: Vec<&str> = scenes.iter().map(|scene| scene.name.as_str()).collect();
        let devices: Vec<&str> = self.devices.iter().map(String::as_str).collect();
        let mut rows = vec![
            ("folder".to_owned(), self.folder.display().to_string()),
            ("viewfuse".to_owned(), viewfuse.clone()),
            ("jobs".to_owned(), job_count.to_string()),
            ("schemes".to_owned(), schemes.join("   ")),
            ("scenes".to_owned(), names.join(", ")),
            ("devices".to_owned(), devices.join(", ")),
        ];
        rows.extend(options.iter().map(|(name, value)| (format!("--{name}"), value.clone())));
        rows.extend(files.iter().map(|(path, digest)| (format!("SHA-256 of {path}"), digest.clone())));
        table::record("Run record", &rows)
    }
}

/// The best rows of a table in a sentence, as far as the intervals decide, and the comparison with the baselines.
fn lead(table: &Table) -> Option<Markup> {
    let metric = table.metrics.get(table.headline)?;
    let cell = |row: &Row| row.cells[table.headline].clone();
    let leading: Vec<&Row> = table.rows.iter().filter(|row| cell(row).is_some_and(|cell| cell.leads)).collect();
    let best = table.rows.iter().find(|row| cell(row).is_some_and(|cell| cell.place == 1))?;
    let value = cell(best)?.value;
    let gain = cell(best)?.versus_reference.filter(|_| leading.len() == 1);
    let sources: Vec<String> = table.source_counts.iter().map(usize::to_string).collect();
    let names: Vec<&str> = leading.iter().map(|row| row.scheme.as_str()).collect();
    Some(html! {
        p.lead {
            "From " (sources.join(", ")) " sources: "
            @match names.as_slice() {
                [] => { "no row is shown to differ from the best; " (metric.label) " at \
                    most " (metric.text(value.mean)) " " (metric.unit) },
                [name] => {
                    "best is " strong { (name) } ", " (metric.label) " " (metric.text(value.mean)) " " (metric.unit)
                    @if let Some(gain) = gain { ", " (metric.interval_text(&gain, true)) " over " (REFERENCE) }
                },
                names => {
                    "best are " strong { (names.join(", ")) } ", not shown to differ; "
                    (metric.label) " " (metric.text(value.mean)) " " (metric.unit)
                },
            }
            "."
        }
        ul.notes { @for verdict in table.verdicts() { li { (verdict) } } }
    })
}

/// Numbers, the first few.
fn named(numbers: &[usize]) -> String {
    let first: Vec<String> = numbers.iter().take(12).map(usize::to_string).collect();
    let more = numbers.len().saturating_sub(12);
    if more > 0 { format!("{} and {more} more", first.join(", ")) } else { first.join(", ") }
}
