use std::path::PathBuf;
use viewfuse_shader_compiler::{backend::Backend, compile};
fn main() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let backend = Backend::find(&root).unwrap();
    if let Some(path) = backend.program_path() {
        unsafe {
            std::env::set_var("PATH", path);
        }
    }
    let target = std::env::current_dir().unwrap().join("../../tmp/shaders-target/x");
    let spv = compile::compile(&backend, &root, &target).unwrap();
    println!("{} {:?}", spv.len(), compile::validate(&spv, &target));
    std::fs::write(root.join("vulkan/src/kernels.spv"), spv).unwrap();
}
