//! The results of a sweep for other programs: JSON with all inputs, and a CSV table of the points.

use super::Point;
use super::difference::Difference;
use super::front::{best_points, fastest_of_same_look, fastest_without_loss, loss};
use serde::{Deserialize, Serialize};
use viewfuse_field::{Denoising, LeftOut};

/// A sweep as written to `pareto.json`. Times are in seconds.
#[derive(Clone, Debug, Serialize)]
pub struct ParetoRecord {
    /// Version of the program.
    pub viewfuse: &'static str,
    /// The scene's path as given.
    pub scene: String,
    /// The field.
    pub field: &'static str,
    /// Where its network's parameters come from; null for a field without a network.
    pub model: Option<String>,
    /// The weighting scheme.
    pub weighting: String,
    /// Seed of every random number.
    pub seed: u64,
    /// Width and height of the pictures.
    pub size: [u32; 2],
    /// Names of the source views.
    pub sources: Vec<String>,
    /// Names of the targets.
    pub targets: Vec<String>,
    /// Number of timed rounds.
    pub round_count: u32,
    /// One entry for each device.
    pub devices: Vec<DeviceRecord>,
    /// Devices that failed, with the error.
    pub failures: Vec<String>,
}

/// A device's points.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DeviceRecord {
    /// The device.
    pub device: String,
    /// How its exact pictures differ from those of the first device of the sweep; null for that one.
    pub exact_versus_first: Option<DifferenceRecord>,
    /// The fastest setting without loss against the photographs ([`fastest_without_loss`]).
    pub fastest_without_loss: Option<String>,
    /// The fastest setting whose pictures look the same as the exact ones ([`fastest_of_same_look`]).
    pub fastest_of_same_look: Option<String>,
    /// One entry for each setting.
    pub points: Vec<PointRecord>,
}

/// A difference. JSON knows neither infinity nor NaN: where a value was NaN or infinite, `root_mean_square` is null;
/// where pictures are equal it is 0 and `psnr` is null.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct DifferenceRecord {
    /// Root mean square over pixels and channels of range 1.
    pub root_mean_square: Option<f64>,
    /// The same as a peak signal to noise ratio in decibels.
    pub psnr: Option<f64>,
    /// The largest difference of a channel.
    pub largest: Option<f64>,
}

impl From<Difference> for DifferenceRecord {
    fn from(difference: Difference) -> DifferenceRecord {
        DifferenceRecord {
            root_mean_square: finite(difference.root_mean_square()),
            psnr: finite(difference.psnr()),
            largest: finite(difference.largest()),
        }
    }
}

/// A setting with its results.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PointRecord {
    /// The setting's short name.
    pub setting: String,
    /// Whether it is on the device's Pareto front of time and error.
    pub best: bool,
    /// Time for a target, encoding included: the median over the rounds.
    pub seconds: f64,
    /// Least and greatest time of the rounds.
    pub seconds_range: [f64; 2],
    /// The part of it for encoding the sources: the median over the rounds.
    pub encode_seconds: f64,
    /// Speed relative to the exact pictures.
    pub gain: f64,
    /// How the pictures differ from the exact ones, not rounded.
    pub versus_exact: DifferenceRecord,
    /// Peak signal to noise ratio against the photographs, decibels, of 8-bit values, mean over the targets that have
    /// one.
    pub truth_psnr: Option<f64>,
    /// Its loss compared with the exact pictures.
    pub truth_loss: Option<f64>,
    /// The work that the field skipped in one round; not read back.
    #[serde(skip_deserializing)]
    pub left_out: Vec<LeftOut>,
    /// The denoising of one round's pictures; null for fields without a denoiser; not read back.
    #[serde(skip_deserializing)]
    pub denoising: Option<Denoising>,
    /// Whether every round rendered the same pictures, bit for bit.
    pub repeatable: bool,
}

/// Longest time and largest ratio of a record, up to the sign: larger ones are not of this program, and no axis holds
/// them.
const MAX_NUMBER: f64 = 1.0e9;

impl PointRecord {
    /// Whether a measurement could have given its numbers.
    pub fn is_possible(&self) -> bool {
        let DifferenceRecord { root_mean_square, psnr, largest } = self.versus_exact;
        let [least, most] = self.seconds_range;
        let times = [self.seconds, least, most, self.encode_seconds];
        let ratios = [root_mean_square, psnr, largest, self.truth_psnr, self.truth_loss, Some(self.gain)];
        times.iter().all(|time| (0.0..=MAX_NUMBER).contains(time))
            && ratios.iter().flatten().all(|ratio| ratio.abs() <= MAX_NUMBER)
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

impl DeviceRecord {
    /// Another program that makes the exact pictures in this time, where this one takes `exact_seconds`.
    pub fn beside(name: &str, seconds: f64, exact_seconds: f64) -> DeviceRecord {
        let versus_exact = DifferenceRecord { root_mean_square: Some(0.0), psnr: None, largest: Some(0.0) };
        let point = PointRecord {
            setting: name.to_owned(),
            best: true,
            seconds,
            seconds_range: [seconds; 2],
            encode_seconds: 0.0,
            gain: exact_seconds / seconds,
            versus_exact,
            truth_psnr: None,
            truth_loss: None,
            left_out: Vec::new(),
            denoising: None,
            repeatable: true,
        };
        DeviceRecord {
            device: name.to_owned(),
            exact_versus_first: None,
            fastest_without_loss: None,
            fastest_of_same_look: None,
            points: vec![point],
        }
    }

    /// The record of a device's points, the exact one first.
    pub fn of(device: String, points: &[Point], exact_versus_first: Option<Difference>) -> Self {
        let exact_seconds = points.first().map_or(f64::NAN, |exact| exact.seconds);
        let record = |(point, best): (&Point, bool)| PointRecord {
            setting: point.setting.clone(),
            best,
            seconds: point.seconds,
            seconds_range: point.seconds_range,
            encode_seconds: point.encode_seconds,
            gain: exact_seconds / point.seconds,
            versus_exact: point.difference.into(),
            truth_psnr: point.truth_psnr.and_then(finite),
            truth_loss: loss(points, point).and_then(finite),
            left_out: point.record.left_out.clone(),
            denoising: point.record.denoising,
            repeatable: point.is_repeatable,
        };
        let words = |point: Option<&Point>| point.map(|point| point.setting.clone());
        DeviceRecord {
            device,
            exact_versus_first: exact_versus_first.map(DifferenceRecord::from),
            fastest_without_loss: words(fastest_without_loss(points)),
            fastest_of_same_look: words(fastest_of_same_look(points)),
            points: points.iter().zip(best_points(points)).map(record).collect(),
        }
    }
}

/// The columns of all fields.
const COLUMNS: &str = "device,setting,best,seconds,seconds_least,seconds_most,encode_seconds,gain,psnr_exact_db,\
    largest_difference,psnr_truth_db,truth_loss_db,repeatable";

/// The points of all devices as CSV, one a line. The PSNR of equal pictures is `inf`, that of pictures with a NaN
/// `NaN`. Fields with a denoiser have a column for its calls in one round. Each kind of work that the field skips has
/// two columns: the amount skipped and the total.
///
/// # Errors
/// Only if memory runs out.
pub fn csv_of(record: &ParetoRecord) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut header: Vec<String> = COLUMNS.split(',').map(str::to_owned).collect();
    let points = || record.devices.iter().flat_map(|device| device.points.iter().map(move |point| (device, point)));
    // Fields with a denoiser have one more column, and all settings are of one field.
    let has_calls = points().any(|(_, point)| point.denoising.is_some());
    if has_calls {
        header.push("calls".to_owned());
    }
    for LeftOut { what, .. } in points().next().iter().flat_map(|(_, point)| &point.left_out) {
        let what = what.replace([' ', '-'], "_");
        header.extend([format!("{what}_left_out"), format!("{what}_of")]);
    }
    writer.write_record(&header)?;
    let optional = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.6}"));
    for (device, point) in points() {
        let DifferenceRecord { root_mean_square, psnr, largest } = point.versus_exact;
        let psnr = match (root_mean_square, psnr) {
            (_, Some(psnr)) => psnr,
            (Some(_), None) => f64::INFINITY,
            (None, None) => f64::NAN,
        };
        let mut line = vec![
            device.device.clone(),
            point.setting.clone(),
            u8::from(point.best).to_string(),
            format!("{:.6}", point.seconds),
            format!("{:.6}", point.seconds_range[0]),
            format!("{:.6}", point.seconds_range[1]),
            format!("{:.6}", point.encode_seconds),
            format!("{:.4}", point.gain),
            format!("{psnr:.4}"),
            format!("{:e}", largest.unwrap_or(f64::NAN)),
            optional(point.truth_psnr),
            optional(point.truth_loss),
            u8::from(point.repeatable).to_string(),
        ];
        if has_calls {
            line.push(point.denoising.map_or(String::new(), |denoising| denoising.calls.to_string()));
        }
        line.extend(point.left_out.iter().flat_map(|row| [row.left_out.to_string(), row.of.to_string()]));
        // Another program leaves out nothing that is counted here.
        line.resize(header.len(), String::new());
        writer.write_record(&line)?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_programs_row_has_all_columns() {
        let mut record = DeviceRecord::beside("CPU", 1.0, 2.0);
        let left_out = LeftOut { what: "volume rows", switch: true, left_out: 3, of: 4, typical_error: "nothing" };
        record.points[0].left_out = vec![left_out];
        record.points[0].denoising = Some(Denoising {
            sampler: "heun",
            levels: Some(25),
            tolerance: None,
            noise: [80.0, 0.002],
            churn: 0.0,
            early_termination: None,
            reuse: None,
            calls: 49,
            saved_calls: 0,
        });
        let record = ParetoRecord {
            viewfuse: "0",
            scene: "scene".to_owned(),
            field: "genvs",
            model: None,
            weighting: "mean".to_owned(),
            seed: 0,
            size: [8, 8],
            sources: Vec::new(),
            targets: Vec::new(),
            round_count: 1,
            devices: vec![record, DeviceRecord::beside("PyTorch", 4.0, 2.0)],
            failures: Vec::new(),
        };
        let table = csv_of(&record).expect("a table");
        let mut reader = csv::Reader::from_reader(table.as_slice());
        let header: Vec<String> = reader.headers().expect("a header").iter().map(str::to_owned).collect();
        assert_eq!(header[13..], ["calls", "volume_rows_left_out", "volume_rows_of"]);
        // The reader refuses rows of different lengths.
        let rows: Vec<Vec<String>> =
            reader.records().map(|row| row.expect("as many columns").iter().map(str::to_owned).collect()).collect();
        assert_eq!(rows[0][13..], ["49", "3", "4"]);
        assert_eq!((rows[1][1].as_str(), rows[1][7].as_str()), ("PyTorch", "0.5000"));
        assert_eq!(rows[1][13..], ["", "", ""]);
    }
}
