//! The process data of a bus as the application sees it (6.5.1.1, 4.3.4.4).

use pdo::Payload;

use super::settings::OBJECTS;

/// Process data of the objects IN 1…IN 4 and OUT 1…OUT 4.
#[derive(Debug, Clone, Copy, Default)]
pub struct Image {
    inputs: [Payload; OBJECTS],
    outputs: [Payload; OBJECTS],
    /// dI: new input data.
    fresh: [bool; OBJECTS],
    /// dO: output data that have not been sent.
    due: [bool; OBJECTS],
}

impl Image {
    /// What came last on object IN `number`, 1…4.
    #[must_use]
    pub fn input(&self, number: usize) -> Option<Payload> {
        self.inputs.get(number.checked_sub(1)?).copied()
    }

    /// Whether object IN `number` has new data; they are old from then on.
    pub fn take_new(&mut self, number: usize) -> bool {
        let place = number.checked_sub(1).and_then(|place| self.fresh.get_mut(place));
        place.is_some_and(core::mem::take)
    }

    /// What goes out with object OUT `number`, 1…4.
    #[must_use]
    pub fn output(&self, number: usize) -> Option<Payload> {
        self.outputs.get(number.checked_sub(1)?).copied()
    }

    /// Sends data with object OUT `number`, 1…4; data that wait are replaced. False for other numbers.
    pub fn write(&mut self, number: usize, data: Payload) -> bool {
        number.checked_sub(1).is_some_and(|place| self.put(place, data))
    }

    pub(super) fn put(&mut self, place: usize, data: Payload) -> bool {
        let (Some(output), Some(due)) = (self.outputs.get_mut(place), self.due.get_mut(place)) else {
            return false;
        };
        *output = data;
        *due = true;
        true
    }

    /// What waits to be sent is not.
    pub(super) fn withdraw(&mut self, place: usize) {
        if let Some(due) = self.due.get_mut(place) {
            *due = false;
        }
    }

    pub(super) fn receive(&mut self, place: usize, data: Payload) {
        if let (Some(input), Some(fresh)) = (self.inputs.get_mut(place), self.fresh.get_mut(place)) {
            *input = data;
            *fresh = true;
        }
    }

    /// The next output to send.
    pub(super) fn take_due(&mut self) -> Option<(usize, Payload)> {
        let place = self.due.iter().position(|&due| due)?;
        *self.due.get_mut(place)? = false;
        Some((place, *self.outputs.get(place)?))
    }
}
