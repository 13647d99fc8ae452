//! Phis of arrays and structs become phis of their members, and what is computed stays the same. A small module is
//! executed before and after.

use crate::execute::{LIMIT, begun, block, execute, finished};
use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{LoopControl, Op, Word};
use std::collections::HashMap;
use viewfuse_shader_compiler::phis::split_phis;
use viewfuse_shader_compiler::refine::read;
use viewfuse_shader_compiler::split::Modules;
use viewfuse_shader_compiler::unroll::unroll;
use viewfuse_tests::places::repository;

/// What a loop carries.
#[derive(Clone, Copy, PartialEq)]
enum Carried {
    /// `{ [a, b], sum }`.
    Struct,
    /// Three numbers by themselves.
    Numbers,
}

/// `{ [a, b], sum } = { [0, 1], 0 }; i = 0; do { [a, b], sum = [b, a + b], sum + a; i += 1 } while i < limit;
/// result = 100 sum + a`, in a loop of one block, which is its own predecessor.
fn module(carried: Carried) -> Module {
    let (mut b, boolean, number) = begun("fibonacci");
    let [zero, one, two, hundred] = [0, 1, 2, 100].map(|value| b.constant_bit32(number, value));
    let pair = b.type_array(number, two);
    let state = b.type_struct([pair, number]);
    let first_pair = b.constant_composite(pair, [zero, one]);
    let first = b.constant_composite(state, [first_pair, zero]);
    let [start, again, out] = std::array::from_fn(|_| b.id());
    let [more, next, next_a, next_b, next_sum] = std::array::from_fn(|_| b.id());
    block(&mut b, start);
    let bound = b.load(number, None, LIMIT, None, []).expect("the limit");
    b.branch(again).expect("a branch");
    block(&mut b, again);
    let (at_a, at_b, at_sum) = match carried {
        Carried::Struct => {
            let held = b.phi(state, None, [(first, start), (next, again)]).expect("a state");
            let count = b.phi(number, None, [(zero, start), (more, again)]).expect("a counter");
            b.i_add(number, Some(more), count, one).expect("a counter");
            let both = b.composite_extract(pair, None, held, [0]).expect("a pair");
            let at_a = b.composite_extract(number, None, both, [0]).expect("a number");
            let at_b = b.composite_extract(number, None, held, [0, 1]).expect("a number");
            (at_a, at_b, b.composite_extract(number, None, held, [1]).expect("a number"))
        }
        Carried::Numbers => {
            let at_a = b.phi(number, None, [(zero, start), (next_a, again)]).expect("a number");
            let at_b = b.phi(number, None, [(one, start), (next_b, again)]).expect("a number");
            let at_sum = b.phi(number, None, [(zero, start), (next_sum, again)]).expect("a number");
            let count = b.phi(number, None, [(zero, start), (more, again)]).expect("a counter");
            b.i_add(number, Some(more), count, one).expect("a counter");
            (at_a, at_b, at_sum)
        }
    };
    b.i_add(number, Some(next_a), at_b, zero).expect("a sum");
    b.i_add(number, Some(next_b), at_a, at_b).expect("a sum");
    b.i_add(number, Some(next_sum), at_sum, at_a).expect("a sum");
    if carried == Carried::Struct {
        let both = b.composite_construct(pair, None, [next_a, next_b]).expect("a pair");
        b.composite_construct(state, Some(next), [both, next_sum]).expect("a state");
    }
    let goes_on = b.u_less_than(boolean, None, more, bound).expect("a condition");
    b.loop_merge(out, again, LoopControl::NONE, []).expect("a loop");
    b.branch_conditional(goes_on, again, out, []).expect("a branch");
    block(&mut b, out);
    let [sum, last] = match carried {
        Carried::Struct => {
            // What leaves the loop joins once more.
            let held = b.phi(state, None, [(next, again)]).expect("a state");
            [&[1][..], &[0, 0]].map(|path| {
                let path: Vec<u32> = path.to_vec();
                b.composite_extract(number, None, held, path).expect("a number")
            })
        }
        Carried::Numbers => [next_sum, next_a],
    };
    let larger = b.i_mul(number, None, sum, hundred).expect("a product");
    let total = b.i_add(number, None, larger, last).expect("a sum");
    finished(b, total)
}

fn bytes(module: &Module) -> Vec<u8> {
    module.assemble().iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// The types of a module's phis.
fn phi_types(module: &Module) -> Vec<Op> {
    let kinds: HashMap<Word, Op> =
        module.types_global_values.iter().filter_map(|kind| Some((kind.result_id?, kind.class.opcode))).collect();
    let instructions = module.functions[0].blocks.iter().flat_map(|block| &block.instructions);
    let phis = instructions.filter(|instruction| instruction.class.opcode == Op::Phi);
    phis.map(|phi| kinds[&phi.result_type.expect("a type")]).collect()
}

/// For limits that leave the loop after the first round, and later: sums of Fibonacci's numbers.
const RESULTS: [(u32, u32); 4] = [(0, 1), (1, 1), (5, 705), (9, 5434)];

#[test]
fn phis_of_structs_and_arrays_become_those_of_their_numbers() {
    let before = module(Carried::Struct);
    assert_eq!(phi_types(&before), [Op::TypeStruct, Op::TypeInt, Op::TypeStruct]);
    let after = read(&split_phis(&bytes(&before), |_| true).expect("SPIR-V")).expect("SPIR-V");
    // Three numbers of the loop and its counter, and three behind it.
    assert_eq!(phi_types(&after), [Op::TypeInt; 7]);
    for (limit, expected) in RESULTS {
        assert_eq!([&before, &after].map(|module| execute(module, limit)), [expected; 2], "{limit}");
    }
    // In each block they stand first, and every number is below the bound and given once.
    let mut given: Vec<Word> = after.all_inst_iter().filter_map(|instruction| instruction.result_id).collect();
    assert!(given.iter().all(|id| *id < after.header.as_ref().expect("a header").bound));
    given.sort_unstable();
    assert!(given.windows(2).all(|pair| pair[0] != pair[1]), "a number is given twice");
    for block in &after.functions[0].blocks {
        let is_phi = |instruction: &Instruction| instruction.class.opcode == Op::Phi;
        let first_other = block.instructions.iter().position(|instruction| !is_phi(instruction));
        assert!(block.instructions[first_other.expect("an end")..].iter().all(|instruction| !is_phi(instruction)));
    }
}

/// How the loops of a module are hinted.
fn hints(module: &Module) -> Vec<LoopControl> {
    let merges = module.all_inst_iter().filter(|instruction| instruction.class.opcode == Op::LoopMerge);
    let hint = |merge: &Instruction| match merge.operands[2] {
        Operand::LoopControl(hint) => hint,
        _ => panic!("a loop without its control"),
    };
    merges.map(hint).collect()
}

#[test]
fn innermost_loops_without_barriers_are_to_be_written_out() {
    let before = module(Carried::Numbers);
    let chosen = read(&unroll(&bytes(&before), |_| true).expect("SPIR-V")).expect("SPIR-V");
    assert_eq!((hints(&before), hints(&chosen)), (vec![LoopControl::NONE], vec![LoopControl::UNROLL]));
    for (limit, expected) in RESULTS {
        assert_eq!(execute(&chosen, limit), expected, "{limit}");
    }
    assert!(unroll(&bytes(&before), |_| false).expect("SPIR-V") == bytes(&before), "another one is chosen");
    assert!(unroll(&[1, 2, 3], |_| true).is_err());
    // The loop over the steps of a tile has loops and barriers inside.
    let tiles = read(&Modules::read(&repository()).expect("the modules").matrices).expect("SPIR-V");
    let hints = hints(&tiles);
    let hinted = hints.iter().filter(|hint| **hint == LoopControl::UNROLL).count();
    assert!(hinted > 0 && hinted < hints.len(), "{hinted} of {}", hints.len());
}

#[test]
fn a_module_of_numbers_stays_as_it_is() {
    let before = module(Carried::Numbers);
    assert!(split_phis(&bytes(&before), |_| true).expect("SPIR-V") == bytes(&before));
    for (limit, expected) in RESULTS {
        assert_eq!(execute(&before, limit), expected, "{limit}");
    }
    assert!(split_phis(&[1, 2, 3], |_| true).is_err());
}
