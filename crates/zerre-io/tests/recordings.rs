//! Real recordings. The large ones are not part of the repository: they are looked for in the folder that the
//! environment variable `ZERRE_DATA` names, or in `shared/data` beside the workspace.

use std::collections::BTreeSet;
use std::path::PathBuf;
use zerre::track::{Plot, Reading};
use zerre::{Span, Time};
use zerre_io::{Format, Geodetic, Options, Recording, TableReader, Trajectories};

fn workspace() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A file of the large recordings; `None`, with a message, where there are none. Continuous integration must have
/// them.
fn recording(path: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("ZERRE_DATA").map_or(workspace().join("../shared/data"), PathBuf::from);
    let file = folder.join(path);
    if file.exists() {
        return Some(file);
    }
    let message = format!("no recording {}: set ZERRE_DATA to the folder that holds it", file.display());
    assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{message}");
    eprintln!("SKIPPED: {message}");
    None
}

fn read(path: &str) -> Option<Recording> {
    recording(path).map(|p| Recording::open(&p, &Options::default()).unwrap())
}

fn targets(plots: &[Plot]) -> usize {
    plots.iter().map(|p| p.id.as_deref().unwrap()).collect::<BTreeSet<_>>().len()
}

#[test]
fn opensky() {
    let Some(r) = read("adsb_ais_uav/OpenSky_Plane_States.csv") else { return };
    assert_eq!(r.summary.format, Format::Opensky);
    let counts = &r.summary.counts;
    assert_eq!((counts.read, counts.used, targets(&r.plots)), (2530, 2210, 36));
    assert_eq!(counts.left_out["repeated report"], 320);
    assert!(counts.rejected.is_empty() && r.repeated == 0);
    let first = r.plots.iter().find(|p| p.line == 2).unwrap();
    assert_eq!(first.time, Time::parse_secs("1626098398.996").unwrap());
    assert_eq!(first.reading, Reading::Position2([0.0, 0.0]), "the first position is the origin");
    // Heights on demand: an airliner in cruise.
    let three_d = Options { three_d: true, ..Options::default() };
    let deep =
        Recording::open(&recording("adsb_ais_uav/OpenSky_Plane_States.csv").unwrap(), &three_d).unwrap();
    assert_eq!(deep.summary.frame.unwrap().origin().alt_m, 10843.26);
    assert!(matches!(deep.plots[0].reading, Reading::Position3(_)));
}

#[test]
fn ships() {
    let Some(r) = read("adsb_ais_uav/SolentAIS_20160112_130211.csv") else { return };
    assert_eq!(r.summary.format, Format::Ais);
    let counts = &r.summary.counts;
    assert_eq!((counts.read, counts.used, targets(&r.plots)), (11207, 11207, 50));
    assert_eq!(r.plots[0].time.nanos(), 1_452_603_731_327_000_000);
    // One report in the recording has a longitude of 54.8 degrees: it is far, not bad.
    let far = |p: &&Plot| p.reading.values()[0].hypot(p.reading.values()[1]) > 1e6;
    assert!(r.plots.iter().filter(far).count() < 20);
}

#[test]
fn vehicle_in_the_air() {
    let Some(r) = read("adsb_ais_uav/UAV_Rot.csv") else { return };
    assert_eq!(r.summary.format, Format::Uav);
    assert_eq!((r.summary.counts.used, targets(&r.plots), r.out_of_order), (965, 1, 0));
    assert_eq!(r.plots[0].id.as_deref(), Some("uav"));
}

#[test]
fn surface_radar() {
    let Some(r) = read("lebl_smr/lebl_smr_28800_30600.csv") else { return };
    assert_eq!(r.summary.format, Format::Lebl);
    let counts = &r.summary.counts;
    assert_eq!((counts.read, counts.used, counts.left_out["no measurement"]), (8461, 8261, 200));
    assert_eq!((counts.missing, targets(&r.plots)), (400, 209));
    // The radar's own Cartesian columns, rounded to a metre, agree with its range and azimuth.
    let first = r.plots.iter().find(|p| p.line == 2).unwrap();
    let Reading::RangeBearing([range, bearing]) = first.reading else { panic!("range and bearing") };
    assert!((range * bearing.cos() - 285.0).abs() < 1.0 && (range * bearing.sin() - 1020.0).abs() < 1.0);
}

/// Every position of the radar comes with a size, where sizes are asked for.
#[test]
fn surface_radar_with_sizes() {
    let Some(file) = recording("lebl_smr/lebl_smr_28800_30600.csv") else { return };
    let r = Recording::open(&file, &Options { sizes: true, ..Options::default() }).unwrap();
    let sizes = r.plots.iter().filter(|p| matches!(p.reading, Reading::Size(_))).count();
    assert_eq!((r.summary.counts.used, sizes, r.plots.len()), (8261, 8261, 2 * 8261));
    // Line 5: 42 m by 29 m, 64.6875 degrees clockwise from north.
    let size = r.plots.iter().find(|p| p.line == 5 && matches!(p.reading, Reading::Size(_))).unwrap();
    let Reading::Size([length, width, orientation]) = size.reading else { panic!("a size") };
    assert_eq!((length, width), (42.0, 29.0));
    assert!((orientation - 25.3125_f64.to_radians()).abs() < 1e-12, "{orientation}");
}

#[test]
fn lidar_points() {
    let Some(r) = read("metu_lidar_vehicle/points.csv") else { return };
    assert_eq!((r.summary.format, r.summary.counts.used, r.out_of_order), (Format::Csv, 5946, 0));
    let times: BTreeSet<_> = r.plots.iter().map(|p| p.time).collect();
    assert_eq!((times.len(), times.first().unwrap().nanos()), (49, 100_000_000));
}

#[test]
fn labelled_frames() {
    let Some(folder) = recording("nuscenes_radar_labeled/scene-0400") else { return };
    let (mut points, mut objects) = (0, BTreeSet::new());
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let r = Recording::open(&path, &Options::default()).unwrap();
        assert_eq!(r.summary.format, Format::Nuscenes);
        if !r.summary.labels {
            points += r.summary.counts.read;
            objects.extend(r.plots.into_iter().filter_map(|p| p.id));
        } else {
            assert_eq!(r.summary.counts.used, 218, "boxes");
        }
    }
    // The recording's description: 1084 points; 1061 of them of objects.
    assert_eq!((points, objects.len()), (1084, 169));
}

#[test]
fn the_small_turning_body_of_the_repository() {
    let r = Recording::open(&workspace().join("data/turning.csv"), &Options::default()).unwrap();
    let truth = Trajectories::open(&workspace().join("data/turning_truth.csv"), &Options::default()).unwrap();
    let way = &truth.by_id[""];
    assert_eq!(way.points().len(), 50);
    for p in &r.plots {
        let Reading::Position2([x, y]) = p.reading else { panic!("a position") };
        let [tx, ty, _] = way.at(p.time, Span::ZERO).unwrap();
        // From the middle of the points the far end of the side is 7.8 m away, and errors are of .15 m.
        assert!((x - tx).hypot(y - ty) < 9.0, "line {}", p.line);
    }
}

#[test]
fn multilateration() {
    let Some(r) = read("lebl_smr/lebl_mlat_28800_30600.csv") else { return };
    assert_eq!(r.summary.format, Format::Lebl);
    let counts = &r.summary.counts;
    assert_eq!((counts.read, counts.left_out["fixed field monitor"]), (20361, 10758));
    assert_eq!((counts.used, targets(&r.plots)), (9603, 22), "28 addresses, 6 of them monitors");
}

/// Radar track 1634 is the aircraft 4ca9cc: the two sensors, each with its own reference point, agree in one frame.
#[test]
fn radar_and_multilateration_agree_in_one_frame() {
    let Some(radar) = read("lebl_smr/lebl_smr_28800_30600.csv") else { return };
    let origin = Some(radar.summary.frame.unwrap().origin());
    let file = recording("lebl_smr/lebl_mlat_28800_30600.csv").unwrap();
    let truth = Trajectories::open(&file, &Options { origin, ..Options::default() }).unwrap();
    let aircraft = &truth.by_id["4ca9cc"];
    let mut distances: Vec<f64> = radar
        .plots
        .iter()
        .filter(|p| p.id.as_deref() == Some("1634"))
        .filter_map(|p| {
            let Reading::RangeBearing([r, b]) = p.reading else { return None };
            let [x, y, _] = aircraft.at(p.time, Span::from_secs(3.0))?;
            Some((r * b.cos() - x).hypot(r * b.sin() - y))
        })
        .collect();
    assert!(distances.len() > 50, "{}", distances.len());
    distances.sort_by(f64::total_cmp);
    // The recording's description states medians of 8 to 19 m between centroid and antenna.
    assert!(distances[distances.len() / 2] < 20.0, "{}", distances[distances.len() / 2]);
}

#[test]
fn streaming_gives_the_rows_of_the_file() {
    let Some(file) = recording("adsb_ais_uav/UAV_Rot.csv") else { return };
    let input = std::io::BufReader::new(std::fs::File::open(file).unwrap());
    let mut reader = TableReader::new("uav", input, &Options::default()).unwrap();
    assert_eq!(reader.frame(), None);
    let first = reader.next().unwrap().unwrap();
    assert_eq!((first.line, reader.counts().read), (2, 1));
    let origin = Geodetic::new(50.2973285, -30.89102916666667, 0.0).unwrap();
    assert_eq!(reader.frame().map(|f| f.origin()), Some(origin));
    assert!(reader.by_ref().all(|p| p.is_ok()));
    assert_eq!(reader.finish().unwrap().counts.used, 965);
}

#[test]
fn the_small_flight_of_the_repository() {
    let r = Recording::open(&workspace().join("data/uav.csv"), &Options::default()).unwrap();
    assert_eq!((r.summary.format, r.summary.counts.used), (Format::Uav, 300));
    let steps = r.plots.windows(2).map(|w| (w[1].time - w[0].time).nanos());
    assert!(steps.clone().all(|s| s == 1_000_000_000), "one position a second");
}

#[test]
fn the_small_ferry_of_the_repository() {
    let radar = Recording::open(&workspace().join("data/ferry_radar.csv"), &Options::default()).unwrap();
    let truth = Trajectories::open(&workspace().join("data/ferry_truth.csv"), &Options::default()).unwrap();
    assert_eq!((radar.plots.len(), targets(&radar.plots)), (133, 2));
    assert_eq!(truth.by_id.values().map(|t| t.points().len()).collect::<Vec<_>>(), [70, 70]);
    for p in &radar.plots {
        let Reading::Position2([x, y]) = p.reading else { panic!("a position") };
        let [tx, ty, _] = truth.by_id[p.id.as_deref().unwrap()].at(p.time, Span::ZERO).unwrap();
        // The gate of the association, and half a millimetre of rounding on four numbers.
        assert!((x - tx).hypot(y - ty) <= 25.001, "line {}", p.line);
    }
}
