//! A sweep of `pareto` on the page.

use super::{ReportError, counted, read, table};
use maud::{Markup, PreEscaped, html};
use serde::Deserialize;
use serde::de::Error;
use std::path::{Path, PathBuf};
use viewfuse_evaluate::pareto::plot;
use viewfuse_evaluate::pareto::record::{DeviceRecord, PointRecord};

/// The parts of `pareto.json` that are shown.
#[derive(Clone, Debug, Deserialize)]
struct Record {
    viewfuse: String,
    scene: String,
    field: String,
    model: Option<String>,
    weighting: String,
    seed: u64,
    size: [u32; 2],
    sources: Vec<String>,
    targets: Vec<String>,
    round_count: u32,
    devices: Vec<DeviceRecord>,
    failures: Vec<String>,
}

/// Error against run time.
#[derive(Clone, Debug)]
pub struct Sweep {
    path: PathBuf,
    record: Record,
}

impl Sweep {
    /// Reads `pareto.json`, or a folder that holds it.
    pub fn open(path: &Path) -> Result<Sweep, ReportError> {
        let path = if path.is_dir() { path.join("pareto.json") } else { path.to_path_buf() };
        let json = |cause| ReportError::Json { path: path.clone(), command: "pareto", cause };
        let record: Record = serde_json::from_slice(&read(&path)?).map_err(json)?;
        if let Some(point) = record.devices.iter().flat_map(|device| &device.points).find(|point| !point.is_possible())
        {
            return Err(json(serde_json::Error::custom(format_args!(
                "a number of the setting '{}' is out of its range",
                point.setting
            ))));
        }
        Ok(Sweep { path, record })
    }

    /// Its heading.
    pub(super) fn title(&self) -> String {
        format!("Error over run time: {}", self.record.field)
    }

    pub(super) fn section(&self, id: &str) -> Result<Markup, ReportError> {
        let Record {
            scene, field, model, weighting, size: [width, height], sources, targets, devices, failures, ..
        } = &self.record;
        let svg = plot::svg("", devices)?;
        Ok(html! {
            section id=(id) {
                h2 { (self.title()) }
                p.facts {
                    span { (scene) }
                    span { "field: " (field) @if let Some(model) = model { " " (model) } }
                    span { (counted(targets.len(), "target")) " of " (width) "×" (height) }
                    span { (counted(sources.len(), "source")) ", " (weighting) }
                }
                @for failure in failures { p.warning { strong { "Failed: " } (failure) } }
                figure.wide { div.scroll.drawn { (PreEscaped(svg)) } figcaption {
                    "Ringed and named: the settings that no other beats in both. " code { "equal" } " is the exact \
                        picture."
                } }
                @for device in devices { (points(device)) }
                (self.record())
            }
        })
    }

    fn record(&self) -> Markup {
        let Record { viewfuse, seed, round_count, sources, targets, .. } = &self.record;
        let rows = [
            ("file", self.path.display().to_string()),
            ("viewfuse", viewfuse.clone()),
            ("seed", seed.to_string()),
            ("timed rounds", round_count.to_string()),
            ("sources", sources.join(", ")),
            ("targets", targets.join(", ")),
        ];
        table::record("Run record", &rows.map(|(name, value)| (name.to_owned(), value)))
    }
}

/// The settings on a device's Pareto front.
fn points(device: &DeviceRecord) -> Markup {
    let mut best: Vec<&PointRecord> = device.points.iter().filter(|point| point.best).collect();
    best.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    let ratio = |psnr: Option<f64>| psnr.map_or_else(|| "equal".to_owned(), |psnr| format!("{psnr:.1}"));
    html! {
        figure.table {
            figcaption { strong { (device.device) } " settings that are the best for their time" }
            div.scroll { table.results {
                thead { tr {
                    th scope="col" { "setting" } th scope="col" { "s / picture" } th scope="col" { "gain" }
                    th scope="col" { "PSNR dB to exact" } th scope="col" { "PSNR dB to truth" }
                } }
                tbody {
                    @for point in best {
                        tr {
                            th scope="row" { (point.setting) }
                            td { (format!("{:.3}", point.seconds)) }
                            td { (format!("{:.2}", point.gain)) "×" }
                            td { (ratio(point.versus_exact.psnr)) }
                            td { @if let Some(psnr) = point.truth_psnr { (format!("{psnr:.2}")) } }
                        }
                    }
                }
            } }
        }
    }
}
