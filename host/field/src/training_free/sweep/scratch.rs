//! Memory that is used again from one frustum to the next: taking it from the system and clearing it was a tenth of the
//! time.

use crate::FieldError;
use viewfuse_device::{Device, Element};
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::evidence::ViewPair;
use viewfuse_kernels::plane_sweep::frustum::SweptView;

/// What is needed while the costs of a frustum are found.
pub(super) struct Scratch<D: Device> {
    pub(super) compared: Slot<D>,
    pub(super) grey: Slot<D>,
    pub(super) evidence: Slot<D>,
    pub(super) sums: Slot<D>,
    pub(super) opacities: Slot<D>,
    pub(super) costs: Slot<D>,
    pub(super) paths: Slot<D>,
    pub(super) views: Known<D, SweptView>,
    pub(super) pairs: Known<D, ViewPair>,
}

impl<D: Device> Default for Scratch<D> {
    fn default() -> Scratch<D> {
        let [compared, grey, evidence, sums, opacities, costs, paths] = std::array::from_fn(|_| Slot::default());
        let (views, pairs) = (Known(Vec::new()), Known(Vec::new()));
        Scratch { compared, grey, evidence, sums, opacities, costs, paths, views, pairs }
    }
}

/// One buffer and its length.
pub(super) struct Slot<D: Device>(Option<(usize, D::Buffer<Planes>)>);

impl<D: Device> Default for Slot<D> {
    fn default() -> Slot<D> {
        Slot(None)
    }
}

impl<D: Device> Slot<D> {
    /// A buffer of this length. Its contents are not defined: the kernels write all that they read.
    pub(super) fn of_len(&mut self, device: &D, len: usize) -> Result<&mut D::Buffer<Planes>, FieldError> {
        let known = self.0.take().filter(|(known, _)| *known == len);
        let slot = match known {
            Some(known) => known,
            None => (len, device.zeros(len)?),
        };
        Ok(&mut self.0.insert(slot).1)
    }
}

/// Most short arrays that stay on the device.
const MAX_KNOWN: usize = 64;

/// Short arrays that are on the device: trials of settings ask for the same ones again and again.
pub(super) struct Known<D: Device, T: Element>(Vec<(Vec<T>, D::Buffer<T>)>);

impl<D: Device, T: Element + PartialEq> Known<D, T> {
    /// A buffer of these values, uploaded if it is not there.
    pub(super) fn of(&mut self, device: &D, values: &[T]) -> Result<&D::Buffer<T>, FieldError> {
        let place = match self.0.iter().position(|(known, _)| known == values) {
            Some(place) => place,
            None => {
                let buffer = device.upload(values)?;
                if self.0.len() == MAX_KNOWN {
                    self.0.remove(0);
                }
                self.0.push((values.to_vec(), buffer));
                self.0.len() - 1
            }
        };
        Ok(&self.0[place].1)
    }
}
