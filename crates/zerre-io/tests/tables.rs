//! Tables of measurements: what is read, what is counted, what is refused and how that is said.

use proptest::prelude::*;
use std::io::Read;
use zerre::Time;
use zerre::track::Reading;
use zerre_io::{Error, Format, Geodetic, Options, Recording, TableReader, Trajectories};

fn read(table: &str) -> Result<Recording, Error> {
    Recording::read("in.csv", table.as_bytes(), &Options::default())
}

/// Reads with any share of rejections allowed.
fn lenient(table: &str) -> Recording {
    let options = Options { max_rejected: 1.0, ..Options::default() };
    Recording::read("in.csv", table.as_bytes(), &options).unwrap()
}

fn message(table: &str) -> String {
    read(table).unwrap_err().to_string()
}

fn readings(recording: &Recording) -> Vec<Reading> {
    recording.plots.iter().map(|p| p.reading).collect()
}

#[test]
fn a_row_gives_its_independent_readings() {
    let table = "time_s,id,sensor,scan,range_m,bearing_rad,elevation_rad,range_rate_mps\n\
                 0.1,a,north,7,100,0.5,0.1,-3\n\
                 0.2,a,north,8,100,0.5,,\n\
                 0.3,a,south,9,100,,,\n\
                 0.4,a,south,9,,0.5,,\n\
                 0.5,a,south,9,,,,\n";
    let recording = read(table).unwrap();
    let want = [
        Reading::RangeBearingElevation([100.0, 0.5, 0.1]),
        Reading::RangeRate(-3.0),
        Reading::RangeBearing([100.0, 0.5]),
        Reading::Range(100.0),
        Reading::Bearing(0.5),
    ];
    assert_eq!(readings(&recording), want);
    let first = &recording.plots[0];
    assert_eq!(first.time, Time::parse_secs("0.1").unwrap());
    assert_eq!((first.id.as_deref(), first.sensor.as_deref()), (Some("a"), Some("north")));
    assert_eq!((first.scan, first.line), (Some(7), 2));
    let counts = &recording.summary.counts;
    assert_eq!((counts.read, counts.used, counts.missing), (5, 4, 12));
    assert_eq!(counts.left_out["no measurement"], 1);
}

#[test]
fn heights_are_left_out_unless_asked_for() {
    let table = "time_s,x_m,y_km,z_m\n0,1,2,3\n1,1,2,\n";
    assert_eq!(readings(&read(table).unwrap()), [Reading::Position2([1.0, 2000.0]); 2]);
    let three_d = Options { three_d: true, ..Options::default() };
    let deep = Recording::read("in.csv", table.as_bytes(), &three_d).unwrap();
    assert_eq!(readings(&deep), [Reading::Position3([1.0, 2000.0, 3.0])]);
    let flat = "time_s,x_m,y_m\n0,1,2\n";
    assert!(matches!(Recording::read("f", flat.as_bytes(), &three_d), Err(Error::NoHeight { .. })));
}

#[test]
fn without_its_elevation_a_slant_range_is_a_sphere() {
    let table = "time_s,range_m,bearing_rad,elevation_rad\n0,100,0.5,0.1\n1,101,0.5,\n2,102,,0.1\n";
    let three_d = Options { three_d: true, ..Options::default() };
    let deep = Recording::read("in.csv", table.as_bytes(), &three_d).unwrap();
    let want = [
        Reading::RangeBearingElevation([100.0, 0.5, 0.1]),
        Reading::Range(101.0),
        Reading::Bearing(0.5),
        Reading::Range(102.0),
    ];
    assert_eq!(readings(&deep), want);
    assert_eq!((deep.summary.counts.used, deep.repeated), (3, 0));
}

/// Sizes are for those who ask, and whole or not there: a missing cell leaves the position.
#[test]
fn sizes_are_read_where_they_are_asked_for() {
    let table =
        "time_s,x_m,y_m,length_m,width_m,heading_deg\n0,1,2,30,25,90\n1,1,2,30,,90\n2,1,2,30,-25,90\n";
    let options = Options { sizes: true, max_rejected: 1.0, ..Options::default() };
    let sized = Recording::read("in.csv", table.as_bytes(), &options).unwrap();
    let at = Reading::Position2([1.0, 2.0]);
    assert_eq!(readings(&sized)[..1], [at]);
    let Reading::Size([length, width, orientation]) = sized.plots[1].reading else { panic!("a size") };
    // Ninety degrees clockwise from north is along x.
    assert_eq!((length, width), (30.0, 25.0));
    assert!(orientation.abs() < 1e-15);
    assert_eq!(readings(&sized)[2..], [at]);
    let counts = &sized.summary.counts;
    assert_eq!((counts.used, counts.missing, counts.rejected["negative length"]), (2, 1, 1));
    let plain = read(table).unwrap();
    assert_eq!(readings(&plain), [at; 3]);
    let names: Vec<&str> = plain.summary.ignored.iter().map(|ignored| ignored.column.as_str()).collect();
    assert_eq!(names, ["length_m", "width_m", "heading_deg"]);
    // Units that are not known are nobody's business then, and an error where sizes are wanted.
    let feet = "time_s,x_m,y_m,length_ft\n0,1,2,30\n";
    assert!(read(feet).is_ok());
    let refused = Recording::read("in.csv", feet.as_bytes(), &options).unwrap_err();
    assert!(matches!(refused, Error::UnknownUnit { .. }), "{refused}");
    for (header, needs) in [
        ("length_m", "width_m and an orientation"),
        ("length_m,width_m", "an orientation"),
        ("heading_rad", "width_m"),
    ] {
        let cells = vec!["1"; header.split(',').count()].join(",");
        let lonely = format!("time_s,x_m,y_m,{header}\n0,1,2,{cells}\n");
        let refused = Recording::read("in.csv", lonely.as_bytes(), &options).unwrap_err();
        assert!(refused.to_string().contains(needs), "{refused}");
    }
}

#[test]
fn seconds_have_two_names() {
    let recording = read("t_s,x_m,y_m\n0.099999999999978328,1,2\n").unwrap();
    assert_eq!(recording.plots[0].time.nanos(), 100_000_000);
    assert!(matches!(read("t_s,time_s,x_m,y_m\n0,0,1,2\n"), Err(Error::DuplicateColumn { .. })));
}

/// Frames have no times of their own: the name of the file, or a column, counts them.
#[test]
fn frames_are_told_from_the_name_of_the_file() {
    let points = "y,x,velocity,motion,time,label\n2,1,3.5,0,0.01,4\n5,4,3.5,0,0.01,-1\n";
    let read = |name: &str| Recording::read(name, points.as_bytes(), &Options::default());
    let frame = read("scene/radar_0400_07.csv").unwrap();
    assert_eq!((frame.summary.format, frame.summary.labels), (Format::Nuscenes, false));
    let [only] = &frame.plots[..] else { panic!("one point of an object") };
    assert_eq!((only.time.secs(), only.scan, only.id.as_deref()), (3.5, Some(7), Some("0400_07/4")));
    assert_eq!(only.reading, Reading::Position2([1.0, 2.0]));
    assert_eq!(frame.summary.counts.left_out["of no object"], 1);
    assert!(frame.summary.ignored.is_empty());
    assert!(matches!(read("radar.csv"), Err(Error::NoFrame { .. })));

    let boxes = "frame,token,name,cx_m,cy_m,cz_m,width_m,length_m,height_m,qw,qx,qy,qz,yaw_rad\n\
                 07,t,car,1,2,0,1.8,4.5,1.5,1,0,0,0,0.5\n,t,car,1,2,0,1.8,4.5,1.5,1,0,0,0,0.5\n";
    let options = Options { sizes: true, max_rejected: 1.0, ..Options::default() };
    let labels = Recording::read("boxes.csv", boxes.as_bytes(), &options).unwrap();
    assert!(labels.summary.labels);
    assert_eq!(readings(&labels), [Reading::Position2([1.0, 2.0]), Reading::Size([4.5, 1.8, 0.5])]);
    assert_eq!((labels.plots[1].scan, labels.plots[1].id.as_deref()), (Some(7), Some("car")));
    assert_eq!(labels.summary.counts.rejected["no frame"], 1);
}

#[test]
fn geographic_positions_become_local() {
    let table =
        "time,lat_deg,lon_deg,alt_m\n2021-07-12T14:00:00Z,50,-1,900\n2021-07-12T14:00:01Z,50.001,-1,900\n";
    let recording = read(table).unwrap();
    let frame = recording.summary.frame.as_ref().unwrap();
    assert_eq!(frame.origin(), Geodetic::new(50.0, -1.0, 0.0).unwrap());
    let Reading::Position2([east, north]) = recording.plots[1].reading else { panic!("a position") };
    // A thousandth of a degree of the meridian at 50 degrees: 111 229 m a degree.
    assert!(east.abs() < 1e-6 && (north - 111.229).abs() < 1e-3, "{east} {north}");

    let given = Geodetic::new(50.001, -1.0, 0.0).unwrap();
    let options = Options { origin: Some(given), ..Options::default() };
    let moved = Recording::read("in.csv", table.as_bytes(), &options).unwrap();
    assert_eq!(moved.summary.frame.unwrap().origin(), given);
    assert_eq!(moved.plots[1].reading, Reading::Position2([0.0, 0.0]));
}

#[test]
fn bad_rows_are_counted_with_place_and_reason() {
    let table = "time_s,x_m,y_m\n0,1,2\n1,NaN,2\n2,1,inf\nx,1,2\n,1,2\n3,1\n4,\"1,2\n\n5,1,2,\n6,1,2\n";
    let recording = lenient(table);
    let counts = &recording.summary.counts;
    assert_eq!((counts.read, counts.used), (9, 2));
    let rejected: Vec<_> = counts.rejected.iter().map(|(reason, n)| (*reason, *n)).collect();
    let want = [
        ("a quote or a line end inside a cell", 1),
        ("another number of cells than the header", 2),
        ("no time", 1),
        ("not a finite number", 2),
        ("not a time in decimal seconds", 1),
    ];
    assert_eq!(rejected, want);
    let first = &recording.summary.rejections[0];
    assert_eq!((first.line, first.column.as_deref(), first.value.as_str()), (3, Some("x_m"), "NaN"));
    assert_eq!(recording.summary.rejections.last().unwrap().line, 10, "blank lines count as lines");
    assert_eq!(recording.plots[1].line, 11);

    let message = message(table);
    assert!(message.contains("7 of 9 rows") && message.contains("line 3, x_m \"NaN\""), "{message}");
}

#[test]
fn one_percent_is_allowed_and_a_hundred_rejections_are_kept() {
    let rows = |good: usize, bad: usize| {
        let mut table = String::from("time_s,x_m,y_m\n");
        table.extend((0..good).map(|i| format!("{i},1,2\n")));
        table.extend((0..bad).map(|_| "0,1,oops\n"));
        table
    };
    assert!(read(&rows(99, 1)).is_ok());
    assert!(matches!(read(&rows(98, 2)), Err(Error::TooManyRejected { rejected: 2, read: 100, .. })));
    let many = lenient(&rows(0, 150));
    assert_eq!(many.summary.rejections.len(), 100);
    assert_eq!(many.summary.counts.rejected["not a number"], 150);
}

#[test]
fn order_is_mended_and_said() {
    let recording = read("time_s,id,x_m,y_m\n2,a,0,0\n1,a,1,0\n2,a,2,0\n2,b,3,0\n3,a,4,0\n").unwrap();
    let lines: Vec<_> = recording.plots.iter().map(|p| p.line).collect();
    assert_eq!(lines, [3, 2, 4, 5, 6]);
    assert_eq!((recording.out_of_order, recording.repeated), (1, 1));
}

#[test]
fn plots_come_as_soon_as_their_line_is_complete() {
    /// Gives one byte at a time, and fails where a live source would wait.
    struct Live(&'static [u8]);
    impl Read for Live {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            let (first, rest) = self.0.split_first().ok_or(std::io::ErrorKind::WouldBlock)?;
            (out[0], self.0) = (*first, rest);
            Ok(1)
        }
    }
    let input = std::io::BufReader::new(Live(b"time_s,x_m,y_m\n0,1,2\n1,3,4\n2,5"));
    let mut reader = TableReader::new("-", input, &Options::default()).unwrap();
    assert!(reader.next().unwrap().is_ok());
    assert_eq!(reader.next().unwrap().unwrap().line, 3);
    assert!(matches!(reader.next(), Some(Err(Error::Read { .. }))));
    assert!(reader.next().is_none(), "an error is the end");
    assert_eq!(reader.finish().unwrap().counts.used, 2);
}

#[test]
fn unknown_columns_are_said_and_mapped_ones_read() {
    let table = "when,X,y_m,comment,x_speed\n0,1,2,hello,3\n";
    let mapping = [("when", "time_s"), ("X", "x_m"), ("comment", "ignore")];
    let columns = mapping.map(|(a, b)| (a.to_owned(), b.to_owned())).into();
    let options = Options { columns, ..Options::default() };
    let recording = Recording::read("in.csv", table.as_bytes(), &options).unwrap();
    assert_eq!(readings(&recording), [Reading::Position2([1.0, 2.0])]);
    let ignored: Vec<_> = recording.summary.ignored.iter().map(|i| i.column.as_str()).collect();
    assert_eq!(ignored, ["x_speed"]);

    let with = |a: &str, b: &str| Options { columns: [(a.into(), b.into())].into(), ..Options::default() };
    let error = |o: &Options| Recording::read("in.csv", table.as_bytes(), o).unwrap_err().to_string();
    assert!(error(&with("when", "time_sec")).contains("did you mean \"time_s\"?"));
    assert!(error(&with("nowhere", "time_s")).contains("\"nowhere\" is not in the header"));
}

#[test]
fn refusals_say_what_and_how_to_mend() {
    let cases = [
        ("", "the file is empty"),
        ("\n \n", "the file is empty"),
        ("0,1,2\n1,2,3\n", "line 1: there is no header, \"0\" looks like data"),
        ("x_m,y_m\n1,2\n", "no column gives the time"),
        ("timestamp,x_m,y_m\n", "does \"timestamp\" mean time_s?"),
        ("time_s;x_m;y_m\n", "separate the columns by commas"),
        ("time_s,id\n", "no column gives a measurement"),
        ("time_s,range\n", "does \"range\" mean range_m?"),
        ("time_s,x_furlong,y_m\n", "\"x_furlong\" has an unknown unit; known are x_m, x_km"),
        ("time_s,x_leagues,y_m\n", "\"x_leagues\" has an unknown unit; known are x_m, x_km"),
        ("time_s,range_smoots\n", "\"range_smoots\" has an unknown unit; known are range_m, range_km"),
        ("time_fortnights,x_m,y_m\n", "\"time_fortnights\" has an unknown unit; known are time_s, time"),
        ("TIME_S,x_m,y_m\n", "column \"TIME_S\" is not known, \"time_s\" is; did you mean it?"),
        ("Time,x_m,y_m\n", "column \"Time\" is not known, \"time\" is; did you mean it?"),
        ("time_s,X_m,y_m\n", "column \"X_m\" is not known, \"x_m\" is; did you mean it?"),
        ("time_s,Range_KM\n", "column \"Range_KM\" is not known, \"range_km\" is; did you mean it?"),
        ("time_s,range_miles\n", "\"range_miles\" has an unknown unit; known are range_m, range_km"),
        ("time_ms,x_m,y_m\n", "\"time_ms\" has an unknown unit; known are time_s"),
        ("time_s,x_m,y_m,x_m\n", "columns \"x_m\" and \"x_m\" both give x"),
        ("time_s,bearing_deg,azimuth_deg\n", "both give the bearing"),
        ("time,time_s,x_m,y_m\n", "both give the time"),
        ("time_s,x_m,y_m,lat_deg,lon_deg\n", "both give the position"),
        ("time_s,x_m\n", "\"x_m\" needs a y"),
        ("time_s,lat_deg\n", "\"lat_deg\" needs lon_deg"),
        ("time_s,elevation_deg,range_m\n", "needs a range and a bearing"),
    ];
    for (table, want) in cases {
        let message = message(table);
        assert!(message.contains(want), "{table:?}: {message}");
        assert!(message.contains("in.csv"), "{message}");
    }
}

#[test]
fn names_in_other_letters_are_ignored_where_they_do_not_matter() {
    let recording = read("time_s,TIME,ID,X_M,x_m,y_m,VX_MPS\n0,noon,7,1,2,3,4\n").unwrap();
    assert_eq!(readings(&recording), [Reading::Position2([2.0, 3.0])]);
    let ignored: Vec<_> =
        recording.summary.ignored.iter().map(|i| (i.column.as_str(), i.did_you_mean)).collect();
    let want = [("TIME", Some("time")), ("ID", Some("id")), ("X_M", Some("x_m")), ("VX_MPS", Some("vx_mps"))];
    assert_eq!(ignored, want);
}

#[test]
fn long_names_are_cut_wherever_they_are_said() {
    let long = "z".repeat(100_000);
    let cut = |text: &str| assert!(text.len() < 1500 && text.contains("zzz..."), "{} bytes", text.len());
    cut(&read(&format!("time_s,x_m,y_m,{long}\n0,1,2,3\n")).unwrap().summary.ignored[0].column);
    cut(&message(&format!("x_m,y_m,{long}\n")));
    cut(&message(&format!("time_s,{long}\n")));
    cut(&message(&format!("{long}\n")));
    let map = |target: &str| {
        let options = Options { columns: [(long.clone(), target.to_owned())].into(), ..Options::default() };
        let table = format!("time_s,x_m,y_m,{long}\n0,1,2,3\n");
        Recording::read("in.csv", table.as_bytes(), &options).unwrap_err().to_string()
    };
    cut(&map("x_m"));
    cut(&map("xm"));
    cut(&map(&"y".repeat(100_000)).replace('y', "z"));
    let absent = Options { columns: [(long.clone(), "x_m".to_owned())].into(), ..Options::default() };
    cut(&Recording::read("in.csv", &b"time_s,x_m,y_m\n"[..], &absent).unwrap_err().to_string());
    let digits = message(&format!("{},1,2\n", "9".repeat(100_000)));
    assert!(digits.len() < 500, "{} bytes", digits.len());
}

#[test]
fn times_out_of_reach_say_column_line_value_and_limit() {
    for text in ["1626098398996000", "-9223372037", "9223372036.9"] {
        let message = message(&format!("time_s,x_m,y_m\n{text},1,2\n"));
        let want =
            format!("line 2, time_s {text:?}: a time more than 9223372036 s (292 years) from the epoch");
        assert!(message.contains(&want) && message.contains("in.csv"), "{message}");
    }
    for text in ["1e3", ".", "-", "1.2.3", "12s"] {
        let message = message(&format!("time_s,x_m,y_m\n{text},1,2\n"));
        assert!(message.contains(&format!("time_s {text:?}: not a time in decimal seconds")), "{message}");
    }
    let dated = message("time,x_m,y_m\n1500-01-01T00:00:00Z,1,2\n");
    let want = "line 2, time \"1500-01-01T00:00:00Z\": a time before 1677 or after 2262";
    assert!(dated.contains(want), "{dated}");
    let options = Options { origin: Some(Geodetic::new(50.0, 0.0, 0.0).unwrap()), ..Options::default() };
    let error = Recording::read("in.csv", &b"time_s,lat_deg,lon_deg\n0,-50,180\n"[..], &options).unwrap_err();
    assert!(error.to_string().contains("line 2, lat_deg \"-50\": too far from the origin"), "{error}");
}

#[test]
fn tables_say_whether_they_know_their_place_on_earth() {
    let geographic = |table: &str| read(table).unwrap().summary.geographic;
    assert!(geographic("time_s,lat_deg,lon_deg\n0,50,-1\n"));
    assert!(geographic("tod,track,rho_m,theta_deg\n0,1,5,6\n"));
    assert!(!geographic("time_s,x_m,y_m\n0,1,2\n"));
}

#[test]
fn bytes_that_are_no_text_are_placed() {
    let refuse = |bytes: &[u8]| Recording::read("in.csv", bytes, &Options::default()).unwrap_err();
    let latin1 = b"time_s,x_m,y_m,name\n0,1,2,caf\xe9\n";
    assert!(matches!(refuse(latin1), Error::NotUtf8 { line: 2, offset: 29, .. }));
    assert!(matches!(refuse(b"\xff\xfet\0i\0m\0e\0"), Error::Utf16 { .. }));
    let bom = b"\xef\xbb\xbftime_s,x_m,y_m\r\n0,1,2\r\n0,1,\xe9\r\n";
    assert!(matches!(refuse(bom), Error::NotUtf8 { line: 3, offset: 30, .. }));
    assert_eq!(read("\u{feff}time_s,x_m,y_m\r\n0,1,2\r\n").unwrap().plots.len(), 1);
}

#[test]
fn a_line_without_end_is_not_swallowed() {
    let endless = b"time_s,x_m,y_m\n0,1,2\n".chain(std::io::repeat(b'7'));
    let error = Recording::read("-", std::io::BufReader::new(endless), &Options::default()).unwrap_err();
    assert!(matches!(error, Error::LineTooLong { line: 3, .. }), "{error}");
}

#[test]
fn a_format_must_fit() {
    let options = Options { format: Format::Ais, ..Options::default() };
    let error = Recording::read("in.csv", &b"time_s,x_m,y_m\n"[..], &options).unwrap_err();
    assert!(error.to_string().contains("no ais table, the column \"MMSI\" is missing"), "{error}");
}

#[test]
fn ships_without_position_are_missing_not_bad() {
    let table = "Time,MMSI,Latitude_degrees,Longitude_degrees\n\
                 2016-01-12 13:02:11.327,1,91,181\n2016-01-12 13:02:12,1,50,-1\n";
    let recording = read(table).unwrap();
    assert_eq!(recording.summary.format, Format::Ais);
    assert_eq!((recording.plots.len(), recording.summary.counts.missing), (1, 2));
}

/// Both sensors see the same metre of concrete: a multilateration position given in the radar's frame is where the
/// geodesy of the two reference points puts it.
#[test]
fn positions_move_between_reference_points() {
    let mlat = "tod,addr,x_m,y_m,rab\n0,a,0,0,0\n";
    let radar = Geodetic::new(41.29561833, 2.095114167, 0.0).unwrap();
    let options = Options { origin: Some(radar), ..Options::default() };
    let truth = Trajectories::read("mlat.csv", mlat.as_bytes(), &options).unwrap();
    let [x, y, _] = truth.by_id["a"].points()[0].position;
    // The flat-earth offset of the recording's description, good to a metre over 1.4 km.
    assert!((x + 1394.0).abs() < 2.0 && (y - 160.4).abs() < 2.0, "{x} {y}");
    let smr = "tod,track,rho_m,theta_deg\n0,1,5,6\n";
    let error = Recording::read("smr.csv", smr.as_bytes(), &options).unwrap_err();
    assert!(matches!(error, Error::PolarOrigin { .. }), "{error}");
}

/// Headers of every format, so that random bodies reach the rows.
const HEADERS: &[&str] = &[
    "time_s,id,scan,x_m,y_m,z_m",
    "time,range_km,azimuth_deg,elevation_deg,range_rate_mps",
    "time_s,lat_deg,lon_deg,alt_m",
    "time,icao24,lat,lon,geoaltitude,lastposupdate",
    "Time,MMSI,Latitude_degrees,Longitude_degrees",
    "time,latitude,longitude,altitude (m)",
    "tod,track,rho_m,theta_deg",
    "tod,addr,x_m,y_m,rab",
];

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = Recording::read("f", &bytes[..], &Options::default());
    }

    #[test]
    fn any_body_is_counted(
        header in prop::sample::select(HEADERS),
        body in "([-0-9.e]{0,4}[,,\n\"aN ]){0,80}",
        three_d in any::<bool>(),
    ) {
        let table = format!("{header}\n{body}");
        let options = Options { max_rejected: 1.0, three_d, ..Options::default() };
        match Recording::read("f", table.as_bytes(), &options) {
            Ok(recording) => {
                let c = &recording.summary.counts;
                let passed: u64 = c.rejected.values().chain(c.left_out.values()).sum();
                prop_assert_eq!(c.read, c.used + passed);
                prop_assert!(recording.plots.iter().all(|p| p.reading.values().iter().all(|v| v.is_finite())));
                prop_assert!(recording.plots.is_sorted_by_key(|p| p.time));
            }
            Err(error) => prop_assert!(matches!(error, Error::NoHeight { .. }), "{}", error),
        }
    }

    /// RFC 4180: any text without a line end comes through its quotes, wherever its cell stands.
    #[test]
    fn quoted_cells_read_back(texts in prop::collection::vec("[a\" ,'\\\\;é#]{0,12}", 3), place in 0..3usize) {
        let quoted: Vec<_> = texts.iter().map(|t| format!("\"{}\"", t.replace('"', "\"\""))).collect();
        let mut header = vec!["time_s", "x_m", "y_m"];
        let mut row = vec!["0", "1", "2"];
        for (name, text) in ["id", "sensor", "comment"].into_iter().zip(&quoted) {
            header.insert(place, name);
            row.insert(place, text);
        }
        let recording = read(&format!("{}\n{}\n", header.join(","), row.join(","))).unwrap();
        let named = |text: &str| Some(text.trim().to_owned()).filter(|t| !t.is_empty());
        prop_assert_eq!(recording.plots[0].id.as_deref().map(str::to_owned), named(&texts[0]));
        prop_assert_eq!(recording.plots[0].sensor.as_deref().map(str::to_owned), named(&texts[1]));
        prop_assert_eq!(recording.plots[0].reading, Reading::Position2([1.0, 2.0]));
    }

    /// What is printed exactly is read exactly, whatever the order of the rows.
    #[test]
    fn positions_read_back(rows in prop::collection::vec((any::<i32>(), -1e9..1e9f64, -1e9..1e9f64), 1..40)) {
        let mut table = String::from("y_m,time_s,x_m\n");
        for (t, x, y) in &rows {
            table += &format!("{y:?},{},{x:?}\n", Time::from_nanos(i64::from(*t)));
        }
        let mut want = rows.clone();
        want.sort_by_key(|r| r.0);
        let got: Vec<_> = read(&table).unwrap().plots.iter().map(|p| (p.time.nanos(), p.reading)).collect();
        let want: Vec<_> =
            want.iter().map(|(t, x, y)| (i64::from(*t), Reading::Position2([*x, *y]))).collect();
        prop_assert_eq!(got, want);
    }
}
