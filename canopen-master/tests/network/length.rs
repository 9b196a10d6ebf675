//! TPDOs of another length than their mapping.

use canopen_master::Frame;
use canopen_master::master::{Event, SubmitError};
use pdo::mapping::LengthError;
use pdo::{DefaultPdo, RpdoFault};

use super::net::{TestMaster, ms, node};

const TPDO: DefaultPdo = DefaultPdo::Second;

/// What the master takes of TPDO 2 of node 5, and what it tells.
fn receive<const N: usize>(master: &mut TestMaster, bytes: [u8; N]) -> (Option<Vec<u8>>, Vec<RpdoFault>) {
    assert!(master.handle_frame(ms(0), &Frame::standard(0x285, bytes)).is_taken());
    let came = master.poll_pdo();
    assert!(came.is_none_or(|came| came == (node(5), TPDO)));
    let data = came.map(|(node, number)| master.pdo(node, number).unwrap().data().to_vec());
    let mut faults = Vec::new();
    while let Some(event) = master.poll_event() {
        let Event::Pdo { node: from, number: TPDO, fault } = event else { panic!("{event:?}") };
        assert_eq!((from, event.node()), (node(5), Some(node(5))));
        faults.push(fault);
    }
    (data, faults)
}

/// As the emergencies 8210h and 8220h say: too few bytes are not processed, too many as far as mapped.
#[test]
fn too_short_is_not_taken_and_too_long_is_cut() {
    let mut master = TestMaster::default();
    master.expect_pdo(node(5), TPDO, Some(4)).unwrap();
    assert_eq!(receive(&mut master, [1, 2, 3, 4]), (Some(vec![1, 2, 3, 4]), vec![]));
    let short = RpdoFault::TooShort(LengthError { expected: 4, found: 3 });
    for _ in 0..2 {
        assert_eq!(receive(&mut master, [9; 3]), (None, vec![short]));
        assert_eq!(master.pdo(node(5), TPDO).unwrap().data(), [1, 2, 3, 4]);
    }
    let long = RpdoFault::TooLong(LengthError { expected: 4, found: 6 });
    assert_eq!(receive(&mut master, [6, 5, 4, 3, 2, 1]), (Some(vec![6, 5, 4, 3]), vec![long]));
    assert_eq!(receive(&mut master, [5; 6]), (Some(vec![5; 4]), vec![]), "told once");
    assert_eq!(receive(&mut master, [4; 4]), (Some(vec![4; 4]), vec![]));
    assert_eq!(receive(&mut master, [3; 6]), (Some(vec![3; 4]), vec![long]), "again after a good one");
}

#[test]
fn any_length_is_taken_until_one_is_expected() {
    let mut master = TestMaster::default();
    assert_eq!(receive(&mut master, []), (Some(vec![]), vec![]));
    assert_eq!(receive(&mut master, [1; 8]), (Some(vec![1; 8]), vec![]));
    master.expect_pdo(node(5), DefaultPdo::First, Some(2)).unwrap();
    assert_eq!(receive(&mut master, [1; 8]), (Some(vec![1; 8]), vec![]), "another PDO");
    master.expect_pdo(node(5), TPDO, Some(0)).unwrap();
    let long = RpdoFault::TooLong(LengthError { expected: 0, found: 1 });
    assert_eq!(receive(&mut master, [1]), (Some(vec![]), vec![long]));
    master.expect_pdo(node(5), TPDO, None).unwrap();
    assert_eq!(receive(&mut master, [1]), (Some(vec![1]), vec![]));
    assert_eq!(master.expect_pdo(node(5), TPDO, Some(9)), Err(SubmitError::Length(9)));
}
