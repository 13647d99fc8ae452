//! Loops of the compiled kernels have the shape that drivers unroll and pipeline, and the pass that gives it to them
//! leaves a loop alone that it would make wrong. Small modules are executed before and after.

use crate::execute::{LIMIT, begun, block, execute, finished};
use rspirv::dr::Module;
use rspirv::spirv::{LoopControl, Op, SelectionControl, StorageClass, Word};
use std::collections::BTreeMap;
use viewfuse_shader_compiler::loops::{Joined, Reason, joined, straighten};
use viewfuse_shader_compiler::refine::read;
use viewfuse_shader_compiler::split::Modules;
use viewfuse_tests::module::{Declarations, id_of, instructions};
use viewfuse_tests::places::repository;

/// Kernels with loops that keep rust-gpu's shape, and how many: a `break` or an early `return` in the body ends them,
/// so that what decides at their end is known in the body alone.
const LEFT_BY_THEIR_BODY: [(&str, usize); 10] = [
    ("blend_gradient", 2),
    ("blend_splats", 1),
    ("find_non_finite", 1),
    ("fine_depths", 1),
    ("gather_latents", 1),
    ("gather_latents_f16", 1),
    ("hull_entry", 2),
    ("march_rays", 2),
    ("match_cost", 1),
    ("sample_mask", 3),
];

/// Kernels with arrays of an invocation's own that a loop's counter indexes. rust-gpu unrolls nothing: until a driver
/// does, these arrays are memory and not registers.
const INDEXED_BY_A_COUNTER: &str = "add_noise blend_gradient blend_planes blend_splats census_cost coarse_depths \
    compare_pixels compare_views compare_windows composite count_entries embed_points follow_paths front_cost \
    gather_gradients hull_entry join_paths list_entries look_up_texels march_rays match_cost measure_windows pick_depth \
    pick_disparity plane_opacity project_gradients project_particles random_draws row_sums step_gains step_harmonics \
    step_particles window_cost";

fn compiled() -> [Module; 4] {
    let modules = Modules::read(&repository()).expect("the compiled kernels");
    modules.named().map(|(_, bytes)| read(bytes).expect("SPIR-V"))
}

#[test]
fn loops_of_kernels_are_straight_but_for_those_that_their_body_ends() {
    let mut kept = BTreeMap::new();
    for Joined { function, kept: reason } in compiled().iter().flat_map(joined) {
        assert_eq!(reason, Some(Reason::BodyDecides), "{function}");
        *kept.entry(function).or_insert(0) += 1;
    }
    let listed = LEFT_BY_THEIR_BODY.map(|(name, count)| (name.to_owned(), count));
    assert_eq!(kept, BTreeMap::from(listed));
}

/// Entry points whose own variables are indexed by what is no constant.
fn indexed(module: &Module) -> Vec<String> {
    let declarations = Declarations::new(module);
    let is_indexed = |entry: Word| {
        let functions = declarations.functions(entry);
        let mut chains = functions
            .iter()
            .flat_map(|function| instructions(function))
            .filter(|instruction| matches!(instruction.class.opcode, Op::AccessChain | Op::InBoundsAccessChain));
        chains.any(|chain| {
            let variable = declarations.variable_behind(id_of(chain, 0));
            let mut indices = (1..chain.operands.len()).map(|index| declarations.definition(id_of(chain, index)));
            declarations.storage_class(variable) == Some(StorageClass::Function)
                && indices.any(|index| index.class.opcode != Op::Constant)
        })
    };
    let entries = module.entry_points.iter().filter(|entry| is_indexed(id_of(entry, 1)));
    entries.map(|entry| entry.operands[2].unwrap_literal_string().to_owned()).collect()
}

#[test]
fn arrays_of_an_invocation_are_indexed_by_values_only_in_listed_kernels() {
    let mut found: Vec<String> = compiled().iter().flat_map(indexed).collect();
    found.sort();
    assert_eq!(found, INDEXED_BY_A_COUNTER.split(' ').collect::<Vec<_>>());
}

/// A loop in rust-gpu's shape and what can make it another.
#[derive(Clone, Copy, Default)]
struct Shape {
    /// What follows the loop takes a value of its join.
    used_outside: bool,
    /// The body ends the loop when the counter is 3.
    ended_by_body: bool,
    /// The exit computes something.
    computing_exit: bool,
    /// The loop goes on while the condition does not hold.
    inverted: bool,
}

/// `sum = 0; i = 0; while i < limit { sum += i; i += 1 } result = sum + i`, where sum and i are 0 in the join if they
/// come from the exit, as rust-gpu leaves them.
fn module(shape: Shape) -> Module {
    let (mut b, boolean, number) = begun("sum");
    let [zero, one, three] = [0, 1, 3].map(|value| b.constant_bit32(number, value));
    let [never, always] = [b.constant_false(boolean), b.constant_true(boolean)];
    let [start, header, top, body, leave, join, again, out] = std::array::from_fn(|_| b.id());
    let [next, more, joined_sum, joined_count, joined_condition] = std::array::from_fn(|_| b.id());
    block(&mut b, start);
    let bound = b.load(number, None, LIMIT, None, []).expect("the limit");
    b.branch(header).expect("a branch");
    block(&mut b, header);
    let count = b.phi(number, None, [(zero, start), (joined_count, again)]).expect("a counter");
    let sum = b.phi(number, None, [(zero, start), (joined_sum, again)]).expect("a sum");
    b.loop_merge(out, again, LoopControl::NONE, []).expect("a loop");
    b.branch(top).expect("a branch");
    block(&mut b, top);
    let condition = if shape.inverted {
        b.u_greater_than_equal(boolean, None, count, bound)
    } else {
        b.u_less_than(boolean, None, count, bound)
    };
    let condition = condition.expect("a condition");
    b.selection_merge(join, SelectionControl::NONE).expect("a selection");
    let sides = if shape.inverted { [leave, body] } else { [body, leave] };
    b.branch_conditional(condition, sides[0], sides[1], []).expect("a branch");
    block(&mut b, body);
    b.i_add(number, Some(next), sum, count).expect("a sum");
    b.i_add(number, Some(more), count, one).expect("a counter");
    let goes_on = b.i_not_equal(boolean, None, count, three).expect("a condition");
    b.branch(join).expect("a branch");
    block(&mut b, leave);
    let at_exit = if shape.computing_exit { b.i_add(number, None, sum, one).expect("a sum") } else { zero };
    b.branch(join).expect("a branch");
    block(&mut b, join);
    b.phi(number, Some(joined_sum), [(next, body), (at_exit, leave)]).expect("a sum");
    b.phi(number, Some(joined_count), [(more, body), (zero, leave)]).expect("a counter");
    let ended = if shape.inverted { always } else { never };
    b.phi(boolean, Some(joined_condition), [(goes_on, body), (ended, leave)]).expect("a condition");
    b.branch(again).expect("a branch");
    block(&mut b, again);
    let sides = if shape.inverted { [out, header] } else { [header, out] };
    let decides = if shape.ended_by_body { joined_condition } else { condition };
    b.branch_conditional(decides, sides[0], sides[1], []).expect("a branch");
    block(&mut b, out);
    let from_end = b.phi(number, None, [(count, again)]).expect("a counter");
    let total = if shape.used_outside || shape.ended_by_body { joined_sum } else { sum };
    let total = b.i_add(number, None, total, from_end).expect("a sum");
    finished(b, total)
}

/// The loops that join, and the results for some limits.
fn state(module: &Module) -> (Vec<Option<Reason>>, [u32; 4]) {
    let reasons = joined(module).into_iter().map(|found| {
        assert_eq!(found.function, "sum");
        found.kept
    });
    (reasons.collect(), [0, 1, 5, 9].map(|limit| execute(module, limit)))
}

#[test]
fn a_loop_is_straightened_and_computes_the_same() {
    for inverted in [false, true] {
        let mut module = module(Shape { inverted, ..Shape::default() });
        let blocks = module.functions[0].blocks.len();
        assert_eq!(state(&module), (vec![None], [0, 1, 15, 45]));
        assert_eq!(straighten(&mut module), 1);
        assert_eq!(state(&module), (Vec::new(), [0, 1, 15, 45]));
        // The exit is gone, and with it the second decision.
        let left = &module.functions[0].blocks;
        let decisions = left.iter().flat_map(|block| &block.instructions);
        let decisions = decisions
            .filter(|instruction| matches!(instruction.class.opcode, Op::BranchConditional | Op::SelectionMerge));
        assert_eq!((left.len(), decisions.count()), (blocks - 1, 1));
        assert_eq!(straighten(&mut module), 0);
    }
}

#[test]
fn a_loop_that_would_be_wrong_is_left_as_it_is() {
    let violations = [
        (Shape { used_outside: true, ..Shape::default() }, Reason::UsedOutside, [0, 1, 5, 9]),
        (Shape { ended_by_body: true, ..Shape::default() }, Reason::BodyDecides, [0, 1, 9, 9]),
        (Shape { computing_exit: true, ..Shape::default() }, Reason::DoesMore, [0, 1, 15, 45]),
        (Shape { computing_exit: true, used_outside: true, ..Shape::default() }, Reason::DoesMore, [1, 2, 16, 46]),
    ];
    for (shape, reason, results) in violations {
        let mut module = module(shape);
        let before = format!("{module:?}");
        assert_eq!(state(&module), (vec![Some(reason)], results));
        assert_eq!(straighten(&mut module), 0);
        assert_eq!(format!("{module:?}"), before);
    }
}
