//! A first-in, first-out queue of fixed size.

#[derive(Debug, Clone)]
pub(crate) struct Ring<T, const N: usize> {
    slots: [Option<T>; N],
    head: usize,
    len: usize,
}

impl<T: Copy, const N: usize> Ring<T, N> {
    pub(crate) const fn new() -> Self {
        Self { slots: [None; N], head: 0, len: 0 }
    }

    pub(crate) const fn len(&self) -> usize {
        self.len
    }

    /// Gives the item back where there is no room.
    pub(crate) fn push(&mut self, item: T) -> Result<(), T> {
        let end = self.head + self.len;
        let index = if end >= N { end - N } else { end };
        match self.slots.get_mut(index) {
            Some(slot) if self.len < N => {
                *slot = Some(item);
                self.len += 1;
                Ok(())
            }
            _ => Err(item),
        }
    }

    pub(crate) fn pop(&mut self) -> Option<T> {
        let item = self.slots.get(self.head).copied()?.filter(|_| self.len > 0)?;
        self.head = if self.head + 1 >= N { 0 } else { self.head + 1 };
        self.len -= 1;
        Some(item)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_in_first_out() {
        let mut ring = Ring::<u8, 3>::new();
        for round in 0..5 {
            assert_eq!(ring.pop(), None);
            for item in 0..3 {
                assert_eq!(ring.push(round + item), Ok(()));
            }
            assert_eq!((ring.push(9), ring.len()), (Err(9), 3));
            assert_eq!(ring.pop(), Some(round));
            assert_eq!(ring.push(7), Ok(()));
            assert_eq!([ring.pop(), ring.pop(), ring.pop()], [Some(round + 1), Some(round + 2), Some(7)]);
        }
        assert_eq!(ring.len(), 0);
    }
}
