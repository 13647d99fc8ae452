//! Memory that is used again from one frustum to the next: taking it from the system and clearing it was a tenth of the
//! time.

use crate::FieldError;
use viewfuse_device::Device;
use viewfuse_kernels::plane_sweep::Planes;

/// What is needed while the costs of a frustum are found.
pub(super) struct Scratch<D: Device> {
    pub(super) compared: Slot<D>,
    pub(super) grey: Slot<D>,
    pub(super) evidence: Slot<D>,
    pub(super) sums: Slot<D>,
    pub(super) opacities: Slot<D>,
    pub(super) costs: Slot<D>,
    pub(super) paths: Slot<D>,
}

impl<D: Device> Default for Scratch<D> {
    fn default() -> Scratch<D> {
        let [compared, grey, evidence, sums, opacities, costs, paths] = std::array::from_fn(|_| Slot::default());
        Scratch { compared, grey, evidence, sums, opacities, costs, paths }
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
