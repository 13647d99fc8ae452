//! How metrics are printed.

use crate::metrics::interval::Interval;
use crate::metrics::masked::{PSNR_MASKED, SSIM_MASKED};
use crate::{PSNR, PSNR_CORRECTED, SSIM};
use serde::Serialize;

/// How a metric is printed and read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Metric {
    /// Its name in files.
    pub name: String,
    /// Its name in tables.
    pub label: String,
    /// Its unit; empty for plain numbers.
    pub unit: &'static str,
    /// Digits behind the point.
    pub decimals: usize,
    /// Whether more is better.
    pub larger_is_better: bool,
}

impl Metric {
    /// The metric of this name. Unknown metrics are distances: less is better.
    pub fn named(name: &str) -> Metric {
        let (label, unit, decimals, larger_is_better) = match name {
            PSNR => ("PSNR".to_owned(), "dB", 2, true),
            PSNR_CORRECTED => ("PSNR corrected".to_owned(), "dB", 2, true),
            SSIM => ("SSIM".to_owned(), "", 3, true),
            PSNR_MASKED => ("PSNR masked".to_owned(), "dB", 2, true),
            SSIM_MASKED => ("SSIM masked".to_owned(), "", 3, true),
            other => (words(other), "", 3, false),
        };
        Metric { name: name.to_owned(), label, unit, decimals, larger_is_better }
    }

    /// The metrics of these names. Together with masked metrics, those of the whole picture are called full.
    pub fn all_named(names: &[&str]) -> Vec<Metric> {
        let mut metrics: Vec<Metric> = names.iter().map(|name| Metric::named(name)).collect();
        let is_masked = |metric: &Metric| [PSNR_MASKED, SSIM_MASKED].contains(&metric.name.as_str());
        if metrics.iter().any(is_masked) {
            let full = metrics.iter_mut().filter(|metric| [PSNR, SSIM].contains(&metric.name.as_str()));
            full.for_each(|metric| metric.label.push_str(" full"));
        }
        metrics
    }

    /// The heading of its column.
    pub fn heading(&self) -> String {
        format!("{} {}", self.label, self.unit).trim_end().to_owned()
    }

    /// A value as text.
    pub fn text(&self, value: f64) -> String {
        format!("{value:.*}", self.decimals)
    }

    /// An interval as text: the mean, followed by half the interval's width if there is one.
    pub fn interval_text(&self, interval: &Interval, signed: bool) -> String {
        let decimals = self.decimals;
        let mean = if signed { format!("{:+.decimals$}", interval.mean) } else { self.text(interval.mean) };
        match interval.half_width {
            Some(half) => format!("{mean} ± {}", self.text(half)),
            None => mean,
        }
    }
}

/// `LPIPS alex` for `lpips-alex`.
fn words(name: &str) -> String {
    let (metric, network) = name.split_once('-').unwrap_or((name, ""));
    format!("{} {network}", metric.to_uppercase()).trim_end().to_owned()
}
