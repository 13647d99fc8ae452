//! Scenes: how they lie on the disk, what is refused with which words, and those that are generated.

mod arrays;
mod colmap;
mod coverage;
mod datasets;
mod errors;
mod formats;
mod gaussian_files;
mod gaussians;
mod generated;
mod large;
mod layouts;
mod lenses;
mod made;
mod masks;
mod match_graph;
mod pages;
mod paths;
mod photographs;
mod targets;
mod transforms;
mod world;
mod written;
