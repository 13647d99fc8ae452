//! NaN and infinity are found by their bits in what becomes SPIR-V: without the execution modes that preserve them,
//! which few drivers have, a compiler may assume that there are none, and then `is_nan` is always false.

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::Op;
use std::collections::BTreeMap;
use viewfuse_shader_compiler::refine::read;
use viewfuse_shader_compiler::split::Modules;
use viewfuse_shader_compiler::stamp::Inputs;
use viewfuse_shader_compiler::tokens::tokens;
use viewfuse_tests::places::repository;

/// Functions of the standard library that a compiler may fold.
const BY_VALUE: [&str; 4] = ["is_nan", "is_finite", "is_infinite", "is_normal"];

/// What tests a value by comparing it: names of the library, and `x != x`.
fn by_value(source: &str) -> Vec<String> {
    let words = tokens(source).expect("Rust");
    let named = words.iter().filter(|word| BY_VALUE.contains(&word.as_str())).cloned();
    // `a != a` is the tokens a, !, =, a.
    let with_itself = words.windows(4).filter(|four| {
        let [left, sign, equal, right] = four else { return false };
        // Of a constant, what stands before it is compared: `x & BITS != BITS`.
        let is_name = left.starts_with(|first: char| first.is_lowercase());
        is_name && left == right && sign == "!" && equal == "="
    });
    named.chain(with_itself.map(|four| four.concat())).collect()
}

#[test]
fn no_source_of_a_kernel_tests_by_value() {
    let inputs = Inputs::read(&repository()).expect("sources");
    let rust = inputs.sources.keys().filter(|path| path.ends_with(".rs") && !path.starts_with("vulkan/compiler"));
    let mut count = 0;
    for path in rust {
        let source = std::fs::read_to_string(repository().join(path)).expect("a source");
        assert_eq!(by_value(&source), Vec::<String>::new(), "{path}: use has_nan_bits and has_finite_bits");
        count += 1;
    }
    assert!(count > 50, "{count} sources");
}

#[test]
fn a_test_by_value_in_a_source_is_seen() {
    assert_eq!(by_value("fn f(x: f32) -> bool { x.is_nan() }"), ["is_nan"]);
    assert_eq!(by_value("fn f(x: f32) -> bool { x != x }"), ["x!=x"]);
    assert_eq!(by_value("fn f(x: f32, y: f32) -> bool { x == y } // is_nan, x != x"), Vec::<String>::new());
}

/// Instructions that test for NaN or infinity, and `x != x`.
fn tests_by_value(module: &Module) -> Vec<&Instruction> {
    // Not `x == x`: the compiler writes it for every conversion to a whole number, whose result for NaN is 0.
    const INEQUALITIES: [Op; 2] = [Op::FOrdNotEqual, Op::FUnordNotEqual];
    let is_one = |instruction: &&Instruction| match instruction.class.opcode {
        Op::IsNan | Op::IsInf | Op::IsFinite | Op::IsNormal | Op::Ordered | Op::Unordered => true,
        code => INEQUALITIES.contains(&code) && instruction.operands[0] == instruction.operands[1],
    };
    module.all_inst_iter().filter(is_one).collect()
}

#[test]
fn no_compiled_kernel_tests_by_value() {
    for (_, bytes) in Modules::read(&repository()).expect("the compiled kernels").named() {
        let mut module = read(bytes).expect("SPIR-V");
        let mut found = BTreeMap::new();
        tests_by_value(&module)
            .into_iter()
            .for_each(|instruction| *found.entry(format!("{:?}", instruction.class.opcode)).or_insert(0) += 1);
        assert!(found.is_empty(), "{found:?}");
        // The search sees one.
        let block = &mut module.functions[0].blocks[0];
        let x = Operand::IdRef(1);
        let test = Instruction::new(Op::FUnordNotEqual, Some(2), Some(3), vec![x.clone(), x]);
        block.instructions.insert(0, test);
        assert_eq!(tests_by_value(&module).len(), 1);
    }
}
