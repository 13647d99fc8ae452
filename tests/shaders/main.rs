//! The compiled kernels: what the list of kernels says, made of the sources that are there, entry points as functions.

mod bits;
mod contract;
mod entry_points;
mod freshness;
