//! Evaluation protocols: what they choose, and `viewfuse evaluate --protocol` through kills, shards and other settings.

mod baselines;
mod benchmarks;
mod choice;
mod folders;
mod summaries;

pub(crate) fn trials() -> Vec<libtest_mimic::Trial> {
    [baselines::trials(), benchmarks::trials(), choice::trials(), folders::trials(), summaries::trials()]
        .into_iter()
        .flatten()
        .collect()
}
