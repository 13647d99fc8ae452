//! The compiled kernels: what the list of kernels says, made of the sources that are there.

mod bits;
mod contract;
mod execute;
mod freshness;
mod loops;
mod phis;
