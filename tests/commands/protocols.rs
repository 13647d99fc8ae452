//! Evaluation protocols: what they choose, and `viewfuse evaluate --protocol` through kills, shards and other settings.

mod baselines;
mod benchmarks;
mod choice;
#[cfg(unix)]
mod cluster;
mod folders;
mod summaries;

viewfuse_tests::trials![[baselines, benchmarks, choice, #[cfg(unix)] cluster, folders, summaries];];
