//! Gives loops the shape that GLSL's `for` has: the branch on the condition leaves the loop.
//!
//! ```text
//! rust-gpu                                         here
//! header: merge out, continue again -> top         header: merge out, continue again -> top
//! top:    condition ? body : leave, merge join     top:    condition ? body : out
//! body:   ...                       -> join        body:   ...                       -> join
//! leave:                            -> join
//! join:   phis of body and leave    -> again       join:                             -> again
//! again:  condition ? header : out                 again:                            -> header
//! ```
//!
//! Drivers neither unroll nor pipeline the first shape. What is computed, and in which order, stays the same.
//!
//! A loop is changed only if the phis of `join` are used inside it alone: outside they would have the values of
//! `leave`, which the body's values take the place of. [`joined`] lists the others, with the reason.

use rspirv::dr::{Block, Function, Instruction, Module, Operand};
use rspirv::spirv::Op;
use std::collections::{HashMap, HashSet};
use std::fmt;

/// A loop whose body and exit join.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Joined {
    /// The function, by the name of its entry point, if it has one.
    pub function: String,
    /// Why it keeps its shape; `None` if it need not.
    pub kept: Option<Reason>,
}

/// Why a loop keeps its shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reason {
    /// The body decides, too, whether the loop goes on: it has a `break`.
    BodyDecides,
    /// What the body or the exit made is used outside the loop.
    UsedOutside,
    /// The exit, the join or the end of the loop does more than carry values on.
    DoesMore,
}

impl fmt::Display for Reason {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        text.write_str(match self {
            Reason::BodyDecides => "its body can end it",
            Reason::UsedOutside => "a value of its join is used outside",
            Reason::DoesMore => "its exit computes something",
        })
    }
}

/// Straightens every loop that may be, and returns how many.
pub fn straighten(module: &mut Module) -> usize {
    module.functions.iter_mut().map(straighten_function).sum()
}

/// The loops of a module whose body and exit join.
pub fn joined(module: &Module) -> Vec<Joined> {
    let mut found = Vec::new();
    for function in &module.functions {
        let is_its = |entry: &&Instruction| id(entry.operands.get(1)) == function.def_id();
        let name = module.entry_points.iter().find(is_its).and_then(|entry| match entry.operands.get(2) {
            Some(Operand::LiteralString(name)) => Some(name.clone()),
            _ => None,
        });
        let name = name.unwrap_or_else(|| format!("%{}", function.def_id().unwrap_or_default()));
        let graph = Graph::new(function);
        let loops = function.blocks.iter().filter_map(|header| graph.parts(header));
        found.extend(loops.map(|parts| Joined { function: name.clone(), kept: graph.reason(&parts) }));
    }
    found
}

/// The blocks of a loop whose body and exit join, by their labels.
#[derive(Clone, Copy)]
struct Parts {
    header: u32,
    top: u32,
    body: u32,
    leave: u32,
    join: u32,
    again: u32,
    out: u32,
    /// What `top` decides on, and what `again` does.
    conditions: [u32; 2],
}

/// A function's blocks by their labels.
struct Graph<'a> {
    function: &'a Function,
    blocks: HashMap<u32, &'a Block>,
}

impl<'a> Graph<'a> {
    fn new(function: &'a Function) -> Graph<'a> {
        let blocks = function.blocks.iter().filter_map(|block| Some((block.label_id()?, block))).collect();
        Graph { function, blocks }
    }

    /// The parts of the loop that begins at a block, if it is one whose body and exit join.
    fn parts(&self, header: &Block) -> Option<Parts> {
        let merge = find(header, Op::LoopMerge)?;
        let (out, again) = (id(merge.operands.first())?, id(merge.operands.get(1))?);
        let top = jump(header)?;
        let [first, body, leave] = decision(self.blocks.get(&top)?)?;
        let join = id(find(self.blocks.get(&top)?, Op::SelectionMerge)?.operands.first())?;
        let [second, on, off] = decision(self.blocks.get(&again)?)?;
        let header = header.label_id()?;
        // Which side leaves the loop: the one that `again` leaves it by.
        let (body, leave) = match (on == header && off == out, off == header && on == out) {
            (true, _) => (body, leave),
            (_, true) => (leave, body),
            _ => return None,
        };
        let parts = Parts { header, top, body, leave, join, again, out, conditions: [first, second] };
        let is_exit = leave != join && body != join && jump(self.blocks.get(&leave)?) == Some(join);
        (is_exit && (first == second || self.is_settled_by_exit(&parts))).then_some(parts)
    }

    /// Whether what decides at the end is a phi whose value from the exit is a constant: it has to be the one that ends
    /// the loop, or there would be no end.
    fn is_settled_by_exit(&self, parts: &Parts) -> bool {
        let is_it = |phi: &&Instruction| phi.result_id == Some(parts.conditions[1]);
        let computed = |id: u32| self.function.all_inst_iter().any(|instruction| instruction.result_id == Some(id));
        let phi = self.blocks.get(&parts.join).and_then(|join| phis(join).find(is_it));
        phi.and_then(|phi| value_from(phi, parts.leave)).is_some_and(|value| !computed(value))
    }

    /// Why a loop has to keep its shape.
    fn reason(&self, parts: &Parts) -> Option<Reason> {
        let [leave, join, again] = [parts.leave, parts.join, parts.again].map(|label| self.blocks[&label]);
        if parts.conditions[0] != parts.conditions[1] {
            return Some(Reason::BodyDecides);
        }
        let carries = |block: &Block, allowed: Op| {
            let mut instructions = block.instructions.iter();
            instructions.all(|instruction| [allowed, Op::Branch].contains(&instruction.class.opcode))
        };
        let has_two = phis(join).all(|phi| phi.operands.len() == 4 && value_from(phi, parts.leave).is_some());
        let is_plain = carries(leave, Op::CompositeExtract)
            && carries(join, Op::Phi)
            && jump(join) == Some(parts.again)
            && again.instructions.len() == 1
            && has_two;
        if !is_plain {
            return Some(Reason::DoesMore);
        }
        let inside = self.inside(parts);
        let made: HashSet<u32> = [leave, join].into_iter().flat_map(results).collect();
        let outside = |block: &&Block| block.label_id().is_some_and(|label| !inside.contains(&label));
        let is_used = self
            .function
            .blocks
            .iter()
            .filter(outside)
            .flat_map(|block| &block.instructions)
            .any(|instruction| references(instruction).any(|used| made.contains(&used)));
        is_used.then_some(Reason::UsedOutside)
    }

    /// The labels of the blocks of a loop: what its header reaches without leaving it.
    fn inside(&self, parts: &Parts) -> HashSet<u32> {
        let (mut inside, mut open) = (HashSet::new(), vec![parts.header]);
        while let Some(label) = open.pop() {
            if label != parts.out && inside.insert(label) {
                let end = self.blocks[&label].instructions.last();
                open.extend(end.into_iter().flat_map(references).filter(|label| self.blocks.contains_key(label)));
            }
        }
        inside
    }
}

/// Straightens the loops of a function one after the other: what one leaves is what the next is made of.
fn straighten_function(function: &mut Function) -> usize {
    let mut count = 0;
    loop {
        let graph = Graph::new(function);
        let parts = function.blocks.iter().filter_map(|header| graph.parts(header));
        let Some(parts) = parts.into_iter().find(|parts| graph.reason(parts).is_none()) else { return count };
        straighten_loop(function, parts);
        count += 1;
    }
}

fn straighten_loop(function: &mut Function, parts: Parts) {
    // What the join's phis become: the loop now goes on from the body alone.
    let mut values = HashMap::new();
    for block in &mut function.blocks {
        let label = block.label_id();
        if label == Some(parts.top) {
            let polarity = [parts.body, parts.out].map(Operand::IdRef);
            leave_at(block, parts.leave, polarity);
        } else if label == Some(parts.join) {
            values.extend(phis(block).filter_map(|phi| Some((phi.result_id?, value_beside(phi, parts.leave)?))));
            block.instructions.retain(|instruction| instruction.class.opcode != Op::Phi);
        } else if label == Some(parts.again) {
            block.instructions = vec![Instruction::new(Op::Branch, None, None, vec![Operand::IdRef(parts.header)])];
        } else if label == Some(parts.out) {
            // What came from the end of the loop now comes from its top.
            let phis = block.instructions.iter_mut().filter(|instruction| instruction.class.opcode == Op::Phi);
            let operands = phis.flat_map(|phi| &mut phi.operands);
            operands.filter(|of| **of == Operand::IdRef(parts.again)).for_each(|of| *of = Operand::IdRef(parts.top));
        }
    }
    function.blocks.retain(|block| block.label_id() != Some(parts.leave));
    for instruction in function.blocks.iter_mut().flat_map(|block| &mut block.instructions) {
        for operand in &mut instruction.operands {
            if let Operand::IdRef(id) = operand {
                *id = values.get(id).copied().unwrap_or(*id);
            }
        }
    }
}

/// Lets the branch at a block's end leave the loop at once.
fn leave_at(top: &mut Block, leave: u32, [body, out]: [Operand; 2]) {
    top.instructions.retain(|instruction| instruction.class.opcode != Op::SelectionMerge);
    let Some(branch) = top.instructions.last_mut() else { return };
    let sides = if id(branch.operands.get(1)) == Some(leave) { [out, body] } else { [body, out] };
    branch.operands.truncate(1);
    branch.operands.extend(sides);
}

fn id(operand: Option<&Operand>) -> Option<u32> {
    operand.and_then(Operand::id_ref_any)
}

fn references(instruction: &Instruction) -> impl Iterator<Item = u32> {
    instruction.operands.iter().filter_map(Operand::id_ref_any)
}

fn results(block: &Block) -> impl Iterator<Item = u32> {
    block.instructions.iter().filter_map(|instruction| instruction.result_id)
}

fn phis(block: &Block) -> impl Iterator<Item = &Instruction> {
    block.instructions.iter().filter(|instruction| instruction.class.opcode == Op::Phi)
}

fn find(block: &Block, operation: Op) -> Option<&Instruction> {
    block.instructions.iter().find(|instruction| instruction.class.opcode == operation)
}

/// Where a block goes, if that is one place.
fn jump(block: &Block) -> Option<u32> {
    let end = block.instructions.last()?;
    if end.class.opcode == Op::Branch { id(end.operands.first()) } else { None }
}

/// The condition and the two places of a block's end, if it has them.
fn decision(block: &Block) -> Option<[u32; 3]> {
    let end = block.instructions.last()?;
    let operand = |index| id(end.operands.get(index));
    if end.class.opcode == Op::BranchConditional { Some([operand(0)?, operand(1)?, operand(2)?]) } else { None }
}

/// A phi's value if the control came from a block.
fn value_from(phi: &Instruction, label: u32) -> Option<u32> {
    phi.operands.chunks(2).find(|pair| id(pair.get(1)) == Some(label)).and_then(|pair| id(pair.first()))
}

/// A phi's first value if it came from another block.
fn value_beside(phi: &Instruction, label: u32) -> Option<u32> {
    phi.operands.chunks(2).find(|pair| id(pair.get(1)) != Some(label)).and_then(|pair| id(pair.first()))
}
