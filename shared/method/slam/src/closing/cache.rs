use super::KeyframeSource;
use crate::Keyframe;

/// Submaps of the query and of the candidates, some of 17 keyframes, lie side by side in it.
const SLOTS: usize = 128;

/// Keyframes by their numbers: each number has one slot.
pub struct Cache {
    slots: Vec<Option<(usize, Keyframe)>>,
}

impl Cache {
    pub fn new() -> Self {
        Self {
            slots: vec![None; SLOTS],
        }
    }

    pub fn get<S: KeyframeSource>(
        &mut self,
        source: &mut S,
        index: usize,
    ) -> Result<&Keyframe, S::Error> {
        let slot = &mut self.slots[index % SLOTS];
        let kept = slot.take().filter(|(kept, _)| *kept == index);
        let keyframe = match kept {
            Some((_, keyframe)) => keyframe,
            None => source.keyframe(index)?,
        };
        Ok(&slot.insert((index, keyframe)).1)
    }
}
