//! Evaluation protocols: what they choose, and `viewfuse evaluate --protocol` through kills, shards and other settings.

#[path = "protocols/choice.rs"]
mod choice;
#[path = "protocols/folders.rs"]
mod folders;
#[path = "protocols/summaries.rs"]
mod summaries;

const BINARY: &str = env!("CARGO_BIN_EXE_viewfuse");
