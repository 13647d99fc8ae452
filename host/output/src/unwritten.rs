//! Frames whose files other threads encode and write, while the next ones are rendered.

use crate::journal::{FinishedFrame, FrameJournal};
use crate::record::FrameRecord;
use std::collections::VecDeque;
use viewfuse_device::queue::{Queue, width};
use viewfuse_job::files::WriteError;

/// Most bytes of frames that wait, beside the last one.
const MAX_BYTES: usize = 512 << 20;

/// A file of a frame, and what writes it.
pub(crate) struct File {
    pub(crate) name: String,
    pub(crate) write: Box<dyn FnOnce() -> Result<(), WriteError> + Send>,
}

/// A frame that is not written yet.
struct Unwritten {
    record: FrameRecord,
    /// Names of its files.
    files: Vec<String>,
    /// Of each file.
    outcomes: Queue<Result<(), WriteError>>,
    /// Of the frame in memory.
    bytes: usize,
}

/// The frames of a run in their order: the last ones are not written yet, those before them are in the journal.
#[derive(Default)]
pub(crate) struct Frames {
    written: Vec<FrameRecord>,
    unwritten: VecDeque<Unwritten>,
    journal: Option<FrameJournal>,
}

impl Frames {
    /// Frames that an earlier start of the run has written, and the journal that goes on.
    pub(crate) fn resumed(written: Vec<FrameRecord>, journal: FrameJournal) -> Frames {
        Frames { written, unwritten: VecDeque::new(), journal: Some(journal) }
    }

    /// The journal, if there is one.
    pub(crate) fn journal(&mut self) -> Option<&mut FrameJournal> {
        self.journal.as_mut()
    }

    /// Begins to write a frame of so many bytes in memory. While as many wait as there are threads, or they take much
    /// memory, it waits for the oldest.
    ///
    /// # Errors
    /// The first of an earlier frame.
    pub(crate) fn add(&mut self, record: FrameRecord, files: Vec<File>, bytes: usize) -> Result<(), WriteError> {
        let held = |frames: &Frames| frames.unwritten.iter().map(|frame| frame.bytes).sum::<usize>();
        while self.unwritten.len() >= width() || (held(self) + bytes > MAX_BYTES && !self.unwritten.is_empty()) {
            self.finish_oldest()?;
        }
        let mut frame = Unwritten { record, files: Vec::new(), outcomes: Queue::default(), bytes };
        for File { name, write } in files {
            frame.outcomes.add(write);
            frame.files.push(name);
        }
        self.unwritten.push_back(frame);
        Ok(())
    }

    /// Waits until all frames are written.
    ///
    /// # Errors
    /// The first, in the order of the frames and of their files.
    pub(crate) fn settle(&mut self) -> Result<(), WriteError> {
        while !self.unwritten.is_empty() {
            self.finish_oldest()?;
        }
        Ok(())
    }

    /// Waits for the oldest frame that is not written, and keeps it in the journal.
    fn finish_oldest(&mut self) -> Result<(), WriteError> {
        let Some(Unwritten { record, files, mut outcomes, .. }) = self.unwritten.pop_front() else { return Ok(()) };
        let mut outcome = Ok(());
        while let Some(next) = outcomes.next_result() {
            outcome = outcome.and(next);
        }
        outcome?;
        if let Some(journal) = &mut self.journal {
            journal.add(&FinishedFrame { frame: record.clone(), files })?;
        }
        self.written.push(record);
        Ok(())
    }

    /// The frames, all of which are written, and the journal.
    ///
    /// # Errors
    /// As [`Frames::settle`].
    pub(crate) fn finished(mut self) -> Result<(Vec<FrameRecord>, Option<FrameJournal>), WriteError> {
        self.settle()?;
        Ok((std::mem::take(&mut self.written), self.journal.take()))
    }
}

impl Drop for Frames {
    /// A run that ends early keeps the frames that it began to write.
    fn drop(&mut self) {
        while !self.unwritten.is_empty() {
            // The error that ends the run was an earlier one.
            let _ = self.finish_oldest();
        }
    }
}
