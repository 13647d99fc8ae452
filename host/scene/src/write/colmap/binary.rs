//! COLMAP's binary files: little endian, a count of 64 bits before what is counted.

use super::{ModelName, ModelView, WrittenPoint};

/// Bytes of a file.
#[derive(Default)]
struct FileBytes(Vec<u8>);

impl FileBytes {
    fn count(&mut self, count: usize) {
        self.0.extend((count as u64).to_le_bytes());
    }

    fn u32(&mut self, number: u32) {
        self.0.extend(number.to_le_bytes());
    }

    fn u64(&mut self, number: u64) {
        self.0.extend(number.to_le_bytes());
    }

    fn f64s(&mut self, numbers: &[f64]) {
        self.0.extend(numbers.iter().copied().flat_map(f64::to_le_bytes));
    }
}

pub(super) fn cameras(views: &[ModelView]) -> Vec<u8> {
    let mut bytes = FileBytes::default();
    bytes.count(views.len());
    for ModelView { id, model: ModelName(_, model), size: [width, height], parameters, .. } in views {
        bytes.u32(*id);
        bytes.u32(*model);
        bytes.u64((*width).into());
        bytes.u64((*height).into());
        bytes.f64s(parameters);
    }
    bytes.0
}

pub(super) fn images(views: &[ModelView]) -> Vec<u8> {
    let mut bytes = FileBytes::default();
    bytes.count(views.len());
    for ModelView { id, rotation, translation, name, observations, .. } in views {
        bytes.u32(*id);
        bytes.f64s(rotation);
        bytes.f64s(translation);
        bytes.u32(*id);
        bytes.0.extend(name.bytes().chain([0]));
        bytes.count(observations.len());
        for (pixel, point) in observations {
            bytes.f64s(pixel);
            bytes.u64(*point);
        }
    }
    bytes.0
}

pub(super) fn points(points: &[WrittenPoint]) -> Vec<u8> {
    let mut bytes = FileBytes::default();
    bytes.count(points.len());
    for WrittenPoint { id, position, colour, error, track } in points {
        bytes.u64(*id);
        bytes.f64s(position);
        bytes.0.extend(colour);
        bytes.f64s(&[*error]);
        bytes.count(track.len());
        track.as_flattened().iter().for_each(|number| bytes.u32(*number));
    }
    bytes.0
}
