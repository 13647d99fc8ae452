//! What the invocations of a workgroup that compute an element together have: memory, and a barrier.

/// Invocations that compute an element together, each of which runs the same function.
pub trait Workgroup {
    /// Writes a number of the workgroup's memory, which exists.
    fn put(&mut self, index: usize, value: f32);

    /// A number of the workgroup's memory, which exists.
    fn get(&self, index: usize) -> f32;

    /// Waits for all invocations, and then sees what they wrote. All call it as often.
    fn wait(&mut self);
}
