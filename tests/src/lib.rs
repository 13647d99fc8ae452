//! What the tests of viewfuse share: scenes built on disk, seeded inputs, comparators that NaN cannot slip through,
//! and the same formulas evaluated in `f64`.
#![forbid(unsafe_code)]

pub mod command;
pub mod compare;
pub mod contract;
pub mod emulator;
pub mod module;
pub mod oracle;
pub mod poses;
pub mod scenes;

pub mod bounded;
pub mod photo_oracle;
