//! Harness of viewfuse's tests: what several of them need to build.
#![forbid(unsafe_code)]

pub mod scenes;
