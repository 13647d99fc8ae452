//! A safetensors file of reference values: its tensors by name, with errors that name them.

use super::{Measure, Quantity, VerifyError};
use safetensors::tensor::Dtype;
use safetensors::{SafeTensors, tensor::TensorView};
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_field::FieldError;
use viewfuse_scene::photographs::{SourceImage, SourceImages};

/// An error with its cause.
pub(super) fn full(error: &FieldError) -> String {
    match error {
        FieldError::Device(cause) => format!("{error}: {cause}"),
        error => error.to_string(),
    }
}

/// The file.
pub(super) struct File<'a> {
    pub(super) path: &'a Path,
    pub(super) tensors: &'a SafeTensors<'a>,
    pub(super) metadata: HashMap<String, String>,
    /// Names of the tensors that were read, or that need not be.
    pub(super) covered: RefCell<BTreeSet<String>>,
}

impl File<'_> {
    /// A text of the file's metadata.
    pub(super) fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.get(key).map(String::as_str)
    }

    /// The error of an invalid tensor.
    pub(super) fn wrong(&self, name: &str, message: impl Into<String>) -> VerifyError {
        VerifyError::Content { path: self.path.to_path_buf(), place: name.to_owned(), message: message.into() }
    }

    /// Whether there is a tensor of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.tensors.tensor(name).is_ok()
    }

    /// Says that a tensor is known.
    pub(super) fn cover(&self, name: &str) {
        self.covered.borrow_mut().insert(name.to_owned());
    }

    /// A tensor of this type.
    pub(super) fn view(&self, name: &str, dtype: Dtype) -> Result<TensorView<'_>, VerifyError> {
        let view = self.tensors.tensor(name).map_err(|error| self.wrong(name, error.to_string()))?;
        if view.dtype() != dtype {
            return Err(self.wrong(name, format!("holds {:?} instead of {dtype:?}", view.dtype())));
        }
        self.cover(name);
        Ok(view)
    }

    /// The numbers of a tensor.
    pub(super) fn floats(&self, name: &str) -> Result<Vec<f32>, VerifyError> {
        let view = self.view(name, Dtype::F32)?;
        Ok(view.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    /// The numbers of a tensor of `f64`.
    pub(super) fn doubles(&self, name: &str) -> Result<Vec<f64>, VerifyError> {
        let view = self.view(name, Dtype::F64)?;
        Ok(view.data().as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
    }

    /// Exactly `count` numbers.
    pub(super) fn many(&self, name: &str, count: usize) -> Result<Vec<f32>, VerifyError> {
        let values = self.floats(name)?;
        match values.len() == count {
            true => Ok(values),
            false => Err(self.wrong(name, format!("has {} numbers instead of {count}", values.len()))),
        }
    }

    /// The same number of values for each row, at least one.
    pub(super) fn many_a_row(&self, name: &str, row_count: usize) -> Result<Vec<f32>, VerifyError> {
        let values = self.floats(name)?;
        match !values.is_empty() && values.len() % row_count == 0 {
            true => Ok(values),
            false => {
                Err(self.wrong(name, format!("{} numbers are not as many for each of {row_count} rays", values.len())))
            }
        }
    }

    /// Rows of `N` numbers.
    pub(super) fn rows<const N: usize>(&self, name: &str) -> Result<Vec<[f32; N]>, VerifyError> {
        let values = self.floats(name)?;
        let (rows, rest) = values.as_chunks::<N>();
        if !rest.is_empty() || rows.is_empty() {
            return Err(self.wrong(name, format!("{} numbers are no rows of {N}", values.len())));
        }
        Ok(rows.to_vec())
    }

    /// The photographs `images` (n, 3, h, w) with `src_poses`; their focal length in pixels is `focal` times a factor.
    pub(super) fn sources(&self, focal: &str, factor: impl Fn(usize) -> f32) -> Result<SourceImages, VerifyError> {
        let images = self.view("images", Dtype::U8)?;
        let &[count, 3, height, width] = images.shape() else {
            return Err(self.wrong("images", format!("has the shape {:?} instead of (n, 3, h, w)", images.shape())));
        };
        let given = *self.floats(focal)?.first().ok_or_else(|| self.wrong(focal, "is empty"))?;
        let principal = [width as f32 / 2.0, height as f32 / 2.0];
        let pinhole = Pinhole::new([given * factor(height); 2], principal, width as u32, height as u32)
            .map_err(|error| self.wrong(focal, error.to_string()))?;
        let poses = self.rows::<16>("src_poses")?;
        if poses.len() != count {
            return Err(self.wrong("src_poses", format!("{} poses of {count} images", poses.len())));
        }
        let pixels = height * width;
        let image = |(view, rows): (usize, &[f32; 16])| {
            let pose = self.pose("src_poses", rows)?;
            let level = |channel: usize, pixel: usize| images.data()[(view * 3 + channel) * pixels + pixel];
            let texels = (0..pixels)
                .map(|pixel| {
                    let [red, green, blue] = [0, 1, 2].map(|channel| f32::from(level(channel, pixel)) / 255.0);
                    [red, green, blue, 1.0]
                })
                .collect();
            Ok(SourceImage { camera: Camera { pose, pinhole }, texels })
        };
        let images = poses.iter().enumerate().map(image).collect::<Result<_, VerifyError>>()?;
        Ok(SourceImages {
            images,
            background: [1.0; 3],
            has_silhouettes: true,
            points: Vec::new(),
            near_far: None,
            focus: None,
            warnings: Vec::new(),
        })
    }

    /// A camera-to-world matrix, row by row.
    pub(super) fn pose(&self, name: &str, rows: &[f32; 16]) -> Result<Pose, VerifyError> {
        let matrix: [[f32; 4]; 4] = std::array::from_fn(|row| std::array::from_fn(|column| rows[row * 4 + column]));
        Pose::from_opengl(&matrix).map_err(|error| self.wrong(name, error.to_string()))
    }

    /// Whole numbers, none of them negative.
    pub(super) fn indices(&self, name: &str) -> Result<Vec<usize>, VerifyError> {
        let view = self.view(name, Dtype::I64)?;
        let index = |bytes: &[u8; 8]| usize::try_from(i64::from_le_bytes(*bytes));
        let indices: Result<Vec<usize>, _> = view.data().as_chunks::<8>().0.iter().map(index).collect();
        indices.map_err(|_| self.wrong(name, "holds a negative index"))
    }
}

/// A quantity whose tolerance is a share of the largest reference value, if `relative`.
pub(super) fn compared(name: String, ours: &[f32], reference: &[f32], tolerance: f64, relative: bool) -> Quantity {
    let largest = reference.iter().fold(0.0_f64, |largest, value| largest.max(f64::from(value.abs())));
    let scale = if relative { largest } else { 1.0 };
    let mut quantity = Quantity::new(name, Measure::Absolute, tolerance * scale);
    let numbers = |values: &[f32]| values.iter().map(|value| f64::from(*value)).collect::<Vec<f64>>();
    quantity.compare_all(numbers(ours), numbers(reference), "value");
    quantity
}
