//! What the invocations of a workgroup that compute an element together have: memory, and a barrier.

/// Invocations that compute an element together, each of which runs the same function.
pub trait Workgroup {
    /// Writes a word of the workgroup's memory, which exists.
    fn put_word(&mut self, index: usize, word: u32);

    /// A word of the workgroup's memory, which exists.
    fn word(&self, index: usize) -> u32;

    /// Writes a number of the workgroup's memory, which exists.
    #[inline(always)]
    fn put(&mut self, index: usize, value: f32) {
        self.put_word(index, value.to_bits());
    }

    /// A number of the workgroup's memory, which exists.
    #[inline(always)]
    fn get(&self, index: usize) -> f32 {
        f32::from_bits(self.word(index))
    }

    /// Waits for all invocations, and then sees what they wrote. All call it as often.
    fn wait(&mut self);
}
