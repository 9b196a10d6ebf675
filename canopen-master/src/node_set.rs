//! A set of node IDs.

use core::fmt;

use pdo::NodeId;

/// Any of the 127 nodes, 16 bytes.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct NodeSet([u32; 4]);

impl NodeSet {
    /// No node.
    pub const EMPTY: Self = Self([0; 4]);
    /// Nodes 1…127.
    pub const ALL: Self = Self([!1, !0, !0, !0]);

    /// Nodes 1 to `last`.
    #[must_use]
    pub fn up_to(last: NodeId) -> Self {
        NodeId::all().take(usize::from(last.raw())).collect()
    }

    /// One node.
    #[must_use]
    pub const fn of(node: NodeId) -> Self {
        let mut set = Self::EMPTY;
        set.insert(node);
        set
    }

    /// Whether no node is in it.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        let [a, b, c, d] = self.0;
        a | b | c | d == 0
    }

    /// How many nodes are in it, 0…127.
    #[must_use]
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub fn len(self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Whether a node is in it.
    #[must_use]
    #[inline]
    pub const fn contains(&self, node: NodeId) -> bool {
        self.0[Self::word(node)] & Self::bit(node) != 0
    }

    /// Puts a node in.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub const fn insert(&mut self, node: NodeId) {
        self.0[Self::word(node)] |= Self::bit(node);
    }

    /// Takes a node out; whether it was in.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub const fn remove(&mut self, node: NodeId) -> bool {
        let was = self.contains(node);
        self.0[Self::word(node)] &= !Self::bit(node);
        was
    }

    /// Nodes in both.
    #[must_use]
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub const fn and(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a & e, b & f, c & g, d & h])
    }

    /// Nodes in either.
    #[must_use]
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub const fn or(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a | e, b | f, c | g, d | h])
    }

    /// Nodes in this one only.
    #[must_use]
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub const fn without(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a & !e, b & !f, c & !g, d & !h])
    }

    /// The lowest.
    #[must_use]
    pub fn first(self) -> Option<NodeId> {
        let (word, bits) = (0..).zip(self.0).find(|(_, bits)| *bits != 0)?;
        NodeId::new(32 * word + bits.trailing_zeros() as u8).ok()
    }

    /// The lowest above `node`, and after the highest the lowest again: for taking turns.
    #[must_use]
    pub fn after(self, node: NodeId) -> Option<NodeId> {
        let mut above = self;
        let split = Self::word(node);
        for (word, bits) in above.0.iter_mut().enumerate() {
            if word < split {
                *bits = 0;
            } else if word == split {
                *bits &= !(Self::bit(node) | (Self::bit(node) - 1));
            }
        }
        above.first().or_else(|| self.first())
    }

    /// Takes the lowest out.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub fn pop(&mut self) -> Option<NodeId> {
        for (word, bits) in (0..).zip(&mut self.0) {
            if *bits != 0 {
                let lowest = bits.trailing_zeros() as u8;
                *bits &= *bits - 1;
                return NodeId::new(32 * word + lowest).ok();
            }
        }
        None
    }

    /// A node ID is below 128: this is in the array.
    const fn word(node: NodeId) -> usize {
        (node.raw() >> 5 & 3) as usize
    }

    const fn bit(node: NodeId) -> u32 {
        1 << (node.raw() & 31)
    }

    /// In order.
    pub fn iter(self) -> impl Iterator<Item = NodeId> {
        let mut rest = self;
        core::iter::from_fn(move || rest.pop())
    }
}

impl FromIterator<NodeId> for NodeSet {
    fn from_iter<I: IntoIterator<Item = NodeId>>(nodes: I) -> Self {
        let mut set = Self::EMPTY;
        for node in nodes {
            set.insert(node);
        }
        set
    }
}

impl fmt::Debug for NodeSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter().map(NodeId::raw)).finish()
    }
}

/// `1, 2, 5`.
impl fmt::Display for NodeSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        self.iter().try_for_each(|node| {
            write!(f, "{separator}{node}")?;
            separator = ", ";
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;

    fn node(id: u8) -> NodeId {
        NodeId::new(id).unwrap()
    }

    #[test]
    fn members() {
        assert_eq!(NodeSet::ALL.len(), 127);
        assert_eq!(NodeSet::up_to(NodeId::MAX), NodeSet::ALL);
        assert_eq!(NodeSet::up_to(node(3)).to_string(), "1, 2, 3");
        let mut set: NodeSet = [node(5), node(127), node(1)].into_iter().collect();
        assert_eq!(set.iter().map(NodeId::raw).collect::<Vec<_>>(), [1, 5, 127]);
        let turns = [1, 4, 5, 126, 127].map(|id| set.after(node(id)).unwrap().raw());
        assert_eq!(turns, [5, 5, 127, 127, 1]);
        assert!(set.remove(node(5)) && !set.remove(node(5)) && !set.contains(node(5)));
        assert_eq!([set.pop(), set.pop(), set.pop()], [Some(node(1)), Some(node(127)), None]);
        assert_eq!((NodeSet::EMPTY.first(), NodeSet::EMPTY.after(node(9))), (None, None));
    }
}
