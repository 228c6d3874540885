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

    pub fn get<E>(
        &mut self,
        read: &mut impl FnMut(usize) -> Result<Keyframe, E>,
        index: usize,
    ) -> Result<&Keyframe, E> {
        let slot = &mut self.slots[index % SLOTS];
        let kept = slot.take().filter(|(kept, _)| *kept == index);
        let keyframe = match kept {
            Some((_, keyframe)) => keyframe,
            None => read(index)?,
        };
        Ok(&slot.insert((index, keyframe)).1)
    }
}
