//! Columns by joint name, by file and by part; one row in n.

use dynident_recording::{Log, LogFormat, LogReader, RawBlock};
use std::fmt::Write as _;
use std::path::Path;

const JOINTS: [&str; 2] = ["elbow", "shoulder"];

/// All rows of the log at `path`.
fn read(path: &Path, format: &str) -> Result<RawBlock, String> {
    let format: LogFormat = toml::from_str(format).unwrap();
    let log = Log::file(path, format, &JOINTS.map(str::to_owned));
    let mut reader = LogReader::open(&log).map_err(|error| error.to_string())?;
    let (mut all, mut block) =
        (RawBlock { q: vec![Vec::new(); 2], tau: vec![Vec::new(); 2], ..RawBlock::default() }, RawBlock::default());
    while reader.next_block(&mut block).map_err(|error| error.to_string())? {
        all.row.extend(&block.row);
        all.time_s.extend(&block.time_s);
        for joint in 0..2 {
            all.q[joint].extend(&block.q[joint]);
            all.tau[joint].extend(&block.tau[joint]);
        }
    }
    Ok(all)
}

/// Time, then positions and torques of shoulder and elbow; the values show column and row.
fn table(rows: impl Iterator<Item = usize>) -> String {
    let mut text = "t,pos[shoulder],pos[elbow],tau[shoulder],tau[elbow]\n".to_owned();
    for row in rows {
        writeln!(text, "{},1{row},2{row},3{row},4{row}", row as f64 * 0.5).unwrap();
    }
    text
}

const BY_NAME: &str = "time.column = \"t\"\nposition.columns = \"pos[{joint}]\"\ntorque.columns = \"tau[{joint}]\"\n";

#[test]
fn columns_follow_the_names_of_joints() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, table(0..3)).unwrap();
    let found = read(&path, BY_NAME).unwrap();
    assert_eq!(found.q, [[20.0, 21.0, 22.0], [10.0, 11.0, 12.0]]);
    assert_eq!(found.tau, [[40.0, 41.0, 42.0], [30.0, 31.0, 32.0]]);
    let missing = read(&path, &BY_NAME.replace("pos[", "place[")).unwrap_err();
    assert!(missing.contains("place[elbow]"), "{missing}");
}

/// Columns with names from `joint_names` of an archive also have the numbers of the matrix.
#[test]
fn columns_with_names_have_numbers_too() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../golden/formats");
    let format = |[elbow, shoulder]: [&str; 2]| {
        let list = |quantity: &str| format!("[\"{quantity}[{elbow}]\", \"{quantity}[{shoulder}]\"]");
        format!("time.column = \"t\"\nposition.columns = {}\ntorque.columns = {}\n", list("q"), list("tau"))
    };
    // The shoulder is the first column.
    let by_number = read(&golden.join("packed.npz"), &format(["1", "0"])).unwrap();
    for names in [["1", "0"], ["elbow", "shoulder"]] {
        assert_eq!(read(&golden.join("named.npz"), &format(names)).unwrap(), by_number, "{names:?}");
    }
    let by_pattern = "time.column = \"t\"\nposition.columns = \"q[{0..1}]\"\ntorque.columns = \"tau[{0..1}]\"\n";
    let mut in_order = read(&golden.join("named.npz"), by_pattern).unwrap();
    in_order.q.reverse();
    assert_eq!(in_order.q, by_number.q);
    let missing = read(&golden.join("named.npz"), &format(["2", "0"])).unwrap_err();
    assert!(missing.contains("q[2]"), "{missing}");
    // Messages and tables state no order of the joints.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, table(0..3)).unwrap();
    let refused = read(&path, &BY_NAME.replace("{joint}", "{0..1}")).unwrap_err();
    assert!(refused.contains("pos[0]"), "{refused}");
}

#[test]
fn one_row_in_n_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let [path, thinned] = ["log.csv", "thinned.csv"].map(|name| folder.path().join(name));
    for rows in [1, 6, 7, 9] {
        std::fs::write(&path, table(0..rows)).unwrap();
        std::fs::write(&thinned, table((0..rows).step_by(3))).unwrap();
        for more in ["", "fraction = [0.0, 0.5]\n", "rows = [1, 3]\n", "drop_rows = [[0, 1]]\n"] {
            let expected = read(&thinned, &format!("{more}{BY_NAME}"));
            let found = read(&path, &format!("keep_every = 3\n{more}{BY_NAME}"));
            assert_eq!(found.is_ok(), expected.is_ok(), "{rows} {more}");
            assert_eq!(found.ok(), expected.ok(), "{rows} {more}");
        }
    }
    // The rate is that of the file.
    let at_rate = BY_NAME.replace("time.column = \"t\"", "rate_hz = 2.0");
    assert_eq!(read(&path, &format!("keep_every = 4\n{at_rate}")).unwrap().time_s, [0.0, 2.0, 4.0]);
    let refused = read(&path, &format!("keep_every = 0\n{BY_NAME}")).unwrap_err();
    assert!(refused.contains("keep_every"), "{refused}");
}

#[test]
fn a_log_may_have_a_file_for_each_joint_and_for_the_time() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("shoulder.csv", "q,tau\n10,30\n11,31\n");
    write("elbow.csv", "q,tau\n20,40\n21,41\n");
    write("clock.csv", "t\n5.0\n5.5\n");
    let format = "time = { column = \"t\", file = \"clock.csv\" }\n\
        position = { columns = \"q\", file = \"{joint}.csv\" }\ntorque = { columns = \"tau\", file = \"{joint}.csv\" }\n";
    let found = read(&folder.path().join("shoulder.csv"), format).unwrap();
    assert_eq!(
        (found.time_s, found.q, found.tau),
        (vec![0.0, 0.5], vec![vec![20.0, 21.0], vec![10.0, 11.0]], vec![vec![40.0, 41.0], vec![30.0, 31.0]])
    );

    // Numbers in the names of files, and one column for each of them.
    for (name, old) in [("axis1.csv", "elbow.csv"), ("axis2.csv", "shoulder.csv")] {
        std::fs::copy(folder.path().join(old), folder.path().join(name)).unwrap();
    }
    let numbered = format.replace("{joint}.csv", "axis{1..2}.csv");
    assert_eq!(read(&folder.path().join("axis1.csv"), &numbered).unwrap().q, [[20.0, 21.0], [10.0, 11.0]]);
    let refused = read(&folder.path().join("axis1.csv"), &format.replace("{joint}.csv", "axis{1..3}.csv")).unwrap_err();
    assert!(refused.contains("position"), "{refused}");
    write("axis2.csv", "q,tau\n10,30\n");
    let refused = read(&folder.path().join("axis1.csv"), &numbered).unwrap_err();
    assert!(refused.contains("axis2.csv"), "{refused}");
}

#[test]
fn a_pattern_names_columns_without_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, table(0..3).lines().skip(1).collect::<Vec<_>>().join("\n")).unwrap();
    let format = "time.column = \"0\"\nposition.columns = \"{1..2}\"\ntorque.columns = [4, \"3\"]\n";
    let found = read(&path, format).unwrap();
    assert_eq!((found.q[0][1], found.q[1][1], found.tau[0][1], found.tau[1][1]), (11.0, 21.0, 41.0, 31.0));
    assert!(read(&path, &format.replace("\"3\"", "\"9\"")).unwrap_err().contains("`9`"));
}

#[test]
fn a_part_of_a_file_is_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.jsonl");
    let row = |part: &str, k: usize| format!("\"{part}\": {{\"t\": {k}, \"q\": [1{k}, 2{k}], \"tau\": [3{k}, 4{k}]}}");
    let lines: Vec<String> = (0..3).map(|k| format!("{{{}, {}}}", row("first", k), row("second", k + 5))).collect();
    std::fs::write(&path, lines.join("\n") + "\n").unwrap();
    let format = "time.column = \"t\"\nposition.columns = \"q[{0..1}]\"\ntorque.columns = \"tau[{0..1}]\"\n";
    let of_part = |part: &str| read(&path, &format!("part = \"{part}\"\n{format}"));
    assert_eq!(of_part("first").unwrap().q, [[10.0, 11.0, 12.0], [20.0, 21.0, 22.0]]);
    assert_eq!(of_part("second").unwrap().q[0], [15.0, 16.0, 17.0]);
    let message = of_part("third").unwrap_err();
    assert!(message.contains("`part`") && message.contains("`third`"), "{message}");
}

#[test]
fn lines_are_columns_of_a_table_on_its_side() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("side.csv");
    // Six samples of three lines without names, then of lines with names.
    std::fs::write(&path, "0,0.5,1,1.5,2,2.5\n10,11,12,13,14,15\n20,21,22,23,24,25\n").unwrap();
    let format = "time.column = 0\nposition.columns = [2, 1]\ntorque.columns = [1, 2]\ntransposed = true\n";
    let found = read(&path, format).unwrap();
    assert_eq!(found.time_s, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]);
    assert_eq!((found.q[0][5], found.q[1][0], found.tau[0][1]), (25.0, 10.0, 11.0));
    let values = |first: u32| (0..9).map(|k| (first + k).to_string()).collect::<Vec<_>>().join(";");
    let named = |name: &str, first: u32| format!("{name};{}\n", values(first));
    let lines = [named("t", 0), named("pos[elbow]", 10), named("pos[shoulder]", 20)].concat();
    std::fs::write(&path, lines + &named("tau[elbow]", 30) + &named("tau[shoulder]", 40)).unwrap();
    let found = read(&path, BY_NAME).unwrap();
    assert_eq!((found.time_s.len(), found.q[0][0], found.q[1][8], found.tau[0][0]), (9, 10.0, 28.0, 30.0));
    // Ranges and rules apply as for other tables.
    let found = read(&path, &format!("{BY_NAME}rows = [2, 5]\n")).unwrap();
    assert_eq!((found.row, &found.tau[1][..]), (vec![2, 3, 4], &[42.0, 43.0, 44.0][..]));
    std::fs::write(&path, "0,1\n2,3,4\n5,6\n").unwrap();
    let message = read(&path, format).unwrap_err();
    assert!(message.contains("line 2: 3 values, the lines before it have 2"), "{message}");
}
