//! Samples that count: the unbroken segments of the motor's clock in which every sample filter holds.

use std::ops::Range;

use crate::log::channel_reader::Channel;
use crate::parquet::column_numbers::RowSelection;
use crate::time::clock::TimeBase;

/// The stretches of the motor's clock that count.
#[derive(Debug, Clone)]
pub(crate) struct SampleSelection {
    pub(crate) segments: Vec<Range<usize>>,
    /// Samples that no condition leaves.
    pub(crate) excluded: usize,
}

impl SampleSelection {
    /// All that is unbroken.
    pub(crate) fn whole(base: &TimeBase) -> Self {
        Self::of(base.segments.clone(), base)
    }

    pub(crate) fn of(segments: Vec<Range<usize>>, base: &TimeBase) -> Self {
        let samples = base.kept.as_ref().map_or(base.rows, Vec::len);
        let excluded = samples - segments.iter().map(Range::len).sum::<usize>();
        Self { segments, excluded }
    }

    pub(crate) fn wanted(&self) -> RowSelection<'_> {
        (self.excluded > 0).then_some(&self.segments)
    }

    /// Removes samples that do not count, so the result does not depend on the page layout.
    pub(crate) fn cut(&self, mut channel: Channel) -> Channel {
        if self.excluded == 0 {
            return channel;
        }
        let mut counted = 0;
        for segment in &self.segments {
            channel.values[counted..segment.start].fill(f64::NAN);
            counted = segment.end;
        }
        channel.values[counted..].fill(f64::NAN);
        (channel.seen, channel.excluded) = (None, self.excluded);
        channel
    }
}
