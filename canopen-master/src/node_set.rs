//! A set of node IDs.

use core::fmt;

use pdo::NodeId;

/// Any of the 127 nodes, 16 bytes.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct NodeSet(u128);

impl NodeSet {
    /// No node.
    pub const EMPTY: Self = Self(0);
    /// Nodes 1…127.
    pub const ALL: Self = Self(!1);

    /// Nodes 1 to `last`.
    #[must_use]
    pub const fn up_to(last: NodeId) -> Self {
        Self(Self::ALL.0 & (u128::MAX >> (127 - last.raw())))
    }

    /// One node.
    #[must_use]
    pub const fn of(node: NodeId) -> Self {
        Self(1 << node.raw())
    }

    /// Whether no node is in it.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// How many nodes are in it, 0…127.
    #[must_use]
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether a node is in it.
    #[must_use]
    pub const fn contains(self, node: NodeId) -> bool {
        self.0 & Self::of(node).0 != 0
    }

    /// Puts a node in.
    pub const fn insert(&mut self, node: NodeId) {
        self.0 |= Self::of(node).0;
    }

    /// Takes a node out; whether it was in.
    pub const fn remove(&mut self, node: NodeId) -> bool {
        let was = self.contains(node);
        self.0 &= !Self::of(node).0;
        was
    }

    /// Nodes in both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Nodes in either.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Nodes in this one only.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// The lowest.
    #[must_use]
    pub const fn first(self) -> Option<NodeId> {
        if self.0 == 0 {
            return None;
        }
        match NodeId::new(self.0.trailing_zeros() as u8) {
            Ok(node) => Some(node),
            Err(_) => None,
        }
    }

    /// The lowest above `node`, and after the highest the lowest again: for taking turns.
    #[must_use]
    pub const fn after(self, node: NodeId) -> Option<NodeId> {
        let above = Self(self.0 & (u128::MAX << node.raw() << 1));
        match above.first() {
            None => self.first(),
            found => found,
        }
    }

    /// Takes the lowest out.
    pub const fn pop(&mut self) -> Option<NodeId> {
        let first = self.first();
        self.0 &= self.0.wrapping_sub(1);
        first
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
