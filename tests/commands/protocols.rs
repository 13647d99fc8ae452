//! Evaluation protocols: what they choose, and `viewfuse evaluate --protocol` through kills, shards and other settings.

mod choice;
mod folders;
mod summaries;
