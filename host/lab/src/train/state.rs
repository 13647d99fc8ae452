//! The saved state of a run: parameters, the optimiser's moments, and the curves so far, in one file that is written
//! completely or not at all.

use super::TrainError;
use super::adam::Adam;
use super::average::Average;
use super::parameters::Parameters;
use candle_core::{DType, Device, Tensor, Var};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use viewfuse_job::files::{read_at_most, write_whole};

/// Progress of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Progressed {
    /// Completed steps.
    pub(crate) steps: u32,
    /// Their time, seconds.
    pub(crate) seconds: f64,
    /// Step and mean loss since the entry before.
    pub(crate) losses: Vec<(u32, f64)>,
    /// Sum and count of the losses since the last entry.
    pub(crate) pending: (f64, u32),
    /// Step and score in validation.
    pub(crate) scores: Vec<(u32, f64)>,
    /// Where the run was made longer: the step that it had come to, and the steps that were planned until then.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) extended: Vec<(u32, u32)>,
}

/// Where the settings have the steps of a run.
pub(crate) const STEPS: &str = "/schedule/steps";

/// Most bytes of a state.
const LONGEST_STATE: u64 = 16 << 30;
/// Largest loss and score, up to the sign, and longest time in seconds, of a run.
const MAX_NUMBER: f64 = 1.0e30;
const MAX_SCORE: f64 = 1.0e9;

impl Progressed {
    /// What is wrong with its numbers, which a damaged file may hold.
    fn check(&self) -> Result<(), String> {
        let Progressed { steps, seconds, losses, pending, scores, extended: _ } = self;
        let sound = |points: &[(u32, f64)], largest: f64| {
            points.iter().all(|(step, value)| step <= steps && value.abs() <= largest)
        };
        let is_time = (0.0..=MAX_NUMBER).contains(seconds);
        match is_time && sound(losses, MAX_NUMBER) && pending.0.abs() <= MAX_NUMBER && sound(scores, MAX_SCORE) {
            true => Ok(()),
            false => Err("its steps, times, losses or scores are out of range".to_owned()),
        }
    }
}

const SETTINGS: &str = "settings";
const PROGRESSED: &str = "progressed";

/// The variables of a run.
pub(crate) struct Learned<'a> {
    pub(crate) parameters: &'a Parameters,
    pub(crate) adam: Adam,
    pub(crate) average: Average,
}

impl Learned<'_> {
    /// Calls `work` while the parameters are those of the run's model: their average.
    pub(crate) fn as_written<R>(&self, work: impl FnOnce() -> candle_core::Result<R>) -> candle_core::Result<R> {
        self.average.during(self.parameters, work)
    }

    /// Every tensor by its name in the file.
    fn tensors(&self) -> Vec<(String, &Var)> {
        let mut all = Vec::new();
        for (name, variable) in self.parameters.iter() {
            let [mean, square] = &self.adam.moments[name];
            let average = &self.average.values[name];
            let tensors = [("parameter", variable), ("mean", mean), ("square", square), ("average", average)];
            all.extend(tensors.map(|(prefix, tensor)| (format!("{prefix}.{name}"), tensor)));
        }
        all
    }
}

/// Writes the state.
pub(crate) fn write(
    path: &Path,
    settings: &Value,
    progressed: &Progressed,
    learned: &Learned<'_>,
) -> Result<(), TrainError> {
    let wrong = |reason: String| TrainError::State { path: path.to_path_buf(), reason };
    let mut bytes: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
    for (name, tensor) in learned.tensors() {
        let values = tensor.flatten_all()?.to_dtype(DType::F64)?.to_vec1::<f64>()?;
        // The numbers are of 32 bits in every run; the wider ones are the tests'.
        let values: Vec<u8> = values.iter().flat_map(|value| (*value as f32).to_le_bytes()).collect();
        bytes.push((name, tensor.dims().to_vec(), values));
    }
    let mut views = BTreeMap::new();
    for (name, shape, bytes) in &bytes {
        let view = TensorView::new(Dtype::F32, shape.clone(), bytes).map_err(|error| wrong(error.to_string()))?;
        views.insert(name.clone(), view);
    }
    let progressed = serde_json::to_string(progressed).map_err(|error| wrong(error.to_string()))?;
    let metadata = HashMap::from([(SETTINGS.to_owned(), settings.to_string()), (PROGRESSED.to_owned(), progressed)]);
    let file = safetensors::serialize(&views, Some(metadata)).map_err(|error| wrong(error.to_string()))?;
    Ok(write_whole(path, &file)?)
}

/// Loads the state into the parameters and moments, if there is one. A run of more steps goes on from one of fewer.
pub(crate) fn read(path: &Path, settings: &Value, learned: &Learned<'_>) -> Result<Option<Progressed>, TrainError> {
    let wrong = |reason: String| TrainError::State { path: path.to_path_buf(), reason };
    let bytes = match read_at_most(path, LONGEST_STATE) {
        // An empty file is of a machine that lost its power: there is nothing to continue.
        Ok(bytes) if bytes.is_empty() => return Ok(None),
        Ok(bytes) => bytes,
        Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(cause) => return Err(wrong(cause.to_string())),
    };
    let Saved { file, settings: mut earlier, mut progressed } = parse(path, &bytes)?;
    let steps = |settings: &Value| settings.pointer(STEPS).and_then(Value::as_u64);
    if let (Some(before), Some(now)) = (steps(&earlier), steps(settings))
        && before < now
    {
        progressed.extended.push((progressed.steps, u32::try_from(before).unwrap_or(u32::MAX)));
        earlier.pointer_mut(STEPS).into_iter().for_each(|steps| *steps = now.into());
    }
    if let Some(difference) = difference(&earlier, settings) {
        return Err(TrainError::OtherRun { path: path.to_path_buf(), difference });
    }
    let value = |name: String, like: &Tensor| -> Result<Tensor, TrainError> {
        let view = file.tensor(&name).map_err(|_| wrong(format!("it has no tensor '{name}'")))?;
        if view.dtype() != Dtype::F32 || view.shape() != like.dims() {
            let shape = like.dims();
            return Err(wrong(format!(
                "its tensor '{name}' is {:?} {:?} instead of F32 {shape:?}",
                view.dtype(),
                view.shape()
            )));
        }
        let numbers =
            view.data().chunks_exact(4).map(|bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
        Ok(Tensor::from_vec(numbers.collect::<Vec<f32>>(), like.shape(), &Device::Cpu)?.to_dtype(like.dtype())?)
    };
    for (name, variable) in learned.tensors() {
        variable.set(&value(name, variable)?)?;
    }
    Ok(Some(progressed))
}

/// The content of a file with a state.
struct Saved<'a> {
    file: SafeTensors<'a>,
    settings: Value,
    progressed: Progressed,
}

/// Parses a state; its tensors are not read yet.
fn parse<'a>(path: &Path, bytes: &'a [u8]) -> Result<Saved<'a>, TrainError> {
    let wrong = |reason: String| TrainError::State { path: path.to_path_buf(), reason };
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| wrong(error.to_string()))?;
    let file = SafeTensors::deserialize(bytes).map_err(|error| wrong(error.to_string()))?;
    let metadata = header.metadata().as_ref();
    let text = |key: &str| metadata.and_then(|all| all.get(key)).ok_or_else(|| wrong(format!("it has no {key}")));
    let settings = serde_json::from_str(text(SETTINGS)?).map_err(|error| wrong(error.to_string()))?;
    let progressed: Progressed = serde_json::from_str(text(PROGRESSED)?).map_err(|error| wrong(error.to_string()))?;
    progressed.check().map_err(wrong)?;
    Ok(Saved { file, settings, progressed })
}

/// Checks that a file is the state of a training run, whatever its settings are; returns its number of steps.
pub fn check_state(path: &Path) -> Result<u32, TrainError> {
    let bytes = read_at_most(path, LONGEST_STATE)
        .map_err(|cause| TrainError::State { path: path.to_path_buf(), reason: cause.to_string() })?;
    Ok(parse(path, &bytes)?.progressed.steps)
}

/// The first difference of the settings, as text.
fn difference(earlier: &Value, now: &Value) -> Option<String> {
    if !(earlier.is_object() && now.is_object()) {
        return (earlier != now).then(|| "its settings are not a list".to_owned());
    }
    first_difference("", Some(earlier), Some(now))
}

/// The first value that differs, by its keys from the outside inwards: `settings.rays was 12 and is 13`.
fn first_difference(place: &str, earlier: Option<&Value>, now: Option<&Value>) -> Option<String> {
    if let (Some(Value::Object(earlier)), Some(Value::Object(now))) = (earlier, now) {
        return earlier.keys().chain(now.keys()).find_map(|key| {
            let place = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
            first_difference(&place, earlier.get(key), now.get(key))
        });
    }
    let shown = |value: Option<&Value>| value.map_or("nothing".to_owned(), Value::to_string);
    (earlier != now).then(|| format!("{place} was {} and is {}", shown(earlier), shown(now)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Else the curves of a run that was killed differ in a last digit from those of one that was not.
    #[test]
    fn numbers_are_read_as_they_were_written() {
        let scores = vec![(4, 13.428_669_558_878_365), (8, 13.447_764_065_263_021)];
        let progressed = Progressed { steps: 8, scores, ..Progressed::default() };
        let text = serde_json::to_string(&progressed).expect("JSON");
        assert_eq!(serde_json::from_str::<Progressed>(&text).expect("JSON"), progressed);
    }
}
