//! Learned attention as a C header, for firmware that links the C face.

use viewfuse_core::attention::FourierEmbedding;

/// A header that defines `viewfuse_attention_parameters[VIEWFUSE_ATTENTION_PARAMETERS]`, as `viewfuse_attend_8` and its
/// sisters take them: constant, so that they stay in flash. A compiler reads the same bits. `origin` names its
/// source in a comment.
pub fn c_header(embedding: &FourierEmbedding, origin: &str) -> String {
    let numbers: Vec<String> = embedding.flat().map(|number| format!("{number:e}f")).collect();
    let lines: Vec<String> = numbers.chunks(8).map(|line| format!("    {},\n", line.join(", "))).collect();
    // What would end the comment, or the line.
    let origin = origin.replace("*/", "* /").replace(char::is_control, " ");
    format!(
        "/* The attention weighting of {origin}, written by viewfuse {version}. Include it in one source file. */\n\
         #ifndef VIEWFUSE_ATTENTION_PARAMETERS_H\n\
         #define VIEWFUSE_ATTENTION_PARAMETERS_H\n\n\
         #include \"viewfuse.h\"\n\n\
         static const float viewfuse_attention_parameters[VIEWFUSE_ATTENTION_PARAMETERS] = {{\n{lines}}};\n\n\
         #endif\n",
        version = env!("CARGO_PKG_VERSION"),
        lines = lines.concat()
    )
}
