//! Evaluation protocols: what they choose, and `viewfuse evaluate --protocol` through kills, shards and other settings.

mod baselines;
mod benchmarks;
mod choice;
#[cfg(unix)]
mod cluster;
mod folders;
mod summaries;

pub(crate) fn trials() -> Vec<libtest_mimic::Trial> {
    [
        baselines::trials(),
        benchmarks::trials(),
        choice::trials(),
        #[cfg(unix)]
        cluster::trials(),
        folders::trials(),
        summaries::trials(),
    ]
    .into_iter()
    .flatten()
    .collect()
}
