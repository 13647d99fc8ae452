//! The recipes of host/evaluate/README.md for many machines, run as they stand there: GNU parallel, and Slurm on one
//! node. A worker that is killed is noticed, and the same recipe goes on.
//!
//! Where GNU parallel or Slurm are missing, these tests are ignored and say so; with `VIEWFUSE_REQUIRE_CLUSTER=1` they
//! fail.

use super::folders::finished;
use crate::{BINARY, done};
use serde_json::Value;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use viewfuse_tests::command::unheard;
use viewfuse_tests::patience::wait_until;
use viewfuse_tests::places::repository;
use viewfuse_tests::scenes::Folder;
use viewfuse_tests::trials::lacking;

const REQUIRED: &str = "VIEWFUSE_REQUIRE_CLUSTER";
/// What the recipes do, made small.
const SMALL: &str = "--protocol random --trials 4 --targets-per-trial 1 --size 64x64 --device cpu --weights mean";

viewfuse_tests::trials![;
    missing(&["parallel"]), REQUIRED => gnu_parallel;
    missing(&["slurmctld", "slurmd", "sbatch"]).or_else(no_root), REQUIRED => slurm_on_one_node,
];

/// The first of these programs that is not on the path.
fn missing(programs: &[&str]) -> Option<String> {
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let is_there = |program: &&str| std::env::split_paths(&paths).any(|folder| folder.join(program).is_file());
    programs.iter().find(|program| !is_there(program)).map(|program| format!("no {program}"))
}

fn no_root() -> Option<String> {
    let user = Command::new("id").arg("-u").output().map(|output| output.stdout);
    lacking(user.is_ok_and(|user| user == b"0\n"), "Slurm's node needs root")
}

/// The block of code that begins like this, of the README.
fn recipe(start: &str) -> String {
    let path = repository().join("host/evaluate/README.md");
    let text = fs::read_to_string(&path).expect("the README");
    let blocks = text.split("\n```").map(|block| block.split_once('\n').map_or("", |(_, code)| code));
    blocks.into_iter().find(|code| code.starts_with(start)).unwrap_or_else(|| panic!("no {start}")).to_owned() + "\n"
}

/// A folder with two scenes of cars, and the command under its name, whose first run in the folder is killed.
struct Workspace {
    folder: Folder,
    /// Where programs are looked for.
    path: String,
}

impl Workspace {
    fn new() -> Workspace {
        let folder = Folder::new();
        done(&folder, "scenes make cars data --train 0 --val 0 --test 2 --views 4 --test-views 6 --size 64");
        // The first worker is killed by its own name, so that none can end before the signal comes.
        let first = "mkdir killed 2>/dev/null && kill -KILL $$\n";
        folder.script("bin/viewfuse", &format!("{first}exec '{BINARY}' \"$@\"\n"));
        let path = std::env::var("PATH").unwrap_or_default();
        Workspace { path: format!("{}:{path}", folder.join("bin").display()), folder }
    }

    /// A recipe as a script: the same with small pictures, into another folder.
    fn script(&self, start: &str, out: &str) -> PathBuf {
        let code = recipe(start);
        assert!(code.contains("--protocol random -o runs/random"), "{code}");
        let code = code.replace("--protocol random -o runs/random", &format!("{SMALL} -o {out}"));
        let path = self.folder.join(format!("{}.sh", out.replace('/', "-")));
        fs::write(&path, code).expect("a script");
        path
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.current_dir(&self.folder).env("PATH", &self.path).stdin(Stdio::null());
        command
    }

    /// The jobs that are done in a folder.
    fn jobs(&self, out: &str) -> Vec<Value> {
        let folder = self.folder.join(out);
        if folder.is_dir() { finished(&folder) } else { Vec::new() }
    }

    /// The numbers of one process.
    fn alone(&self) -> Vec<Value> {
        done(&self.folder, &format!("evaluate data/cars --split test {SMALL} -o alone"));
        let jobs = self.jobs("alone");
        assert_eq!(jobs.len(), 8);
        jobs
    }

    /// The same command without shards computes what is missing, which is nothing.
    fn assert_whole(&self, out: &str, expected: &[Value]) {
        assert_eq!(self.jobs(out), expected);
        let text = done(&self.folder, &format!("evaluate data/cars --split test {SMALL} -o {out}"));
        assert!(text.contains("mean"), "{text}");
        assert_eq!(self.jobs(out), expected);
    }
}

fn gnu_parallel() {
    let workspace = Workspace::new();
    let expected = workspace.alone();
    let script = workspace.script("# GNU parallel", "runs/parallel");
    let run = || {
        let mut command = workspace.command("sh");
        command.arg(&script);
        unheard(command)
    };
    // GNU parallel's exit code is how many of its jobs failed.
    assert_eq!(run().wait().expect("an end").code(), Some(1));
    assert_eq!(workspace.jobs("runs/parallel").len(), expected.len() - 1, "the killed worker's job is missing");
    assert_eq!(run().wait().expect("an end").code(), Some(0));
    workspace.assert_whole("runs/parallel", &expected);
}

/// Slurm's two daemons, which end with this value.
struct Slurm {
    daemons: Vec<Child>,
    settings: PathBuf,
}

impl Slurm {
    fn start(workspace: &Workspace) -> Slurm {
        let folder = workspace.folder.join("slurm");
        ["state", "spool"].iter().for_each(|name| fs::create_dir_all(folder.join(name)).expect("a folder"));
        let host = Command::new("hostname").arg("-s").output().expect("a name").stdout;
        let host = String::from_utf8(host).expect("a name").trim().to_owned();
        // Two ports that are free now.
        let free = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").expect("a port"));
        let [controls, node] = free.map(|listener| listener.local_addr().expect("a port").port());
        let settings = folder.join("slurm.conf");
        let text = format!(
            "ClusterName=viewfuse\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={controls}\nSlurmdPort={node}\n\
             AuthType=auth/none\nCredType=cred/none\nSlurmUser=root\nSlurmdUser=root\n\
             StateSaveLocation={0}/state\nSlurmdSpoolDir={0}/spool\n\
             SlurmctldPidFile={0}/slurmctld.pid\nSlurmdPidFile={0}/slurmd.pid\n\
             ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nMpiDefault=none\nReturnToService=2\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\nJobAcctGatherType=jobacct_gather/none\n\
             AccountingStorageType=accounting_storage/none\nNodeName={host} NodeAddr=127.0.0.1 CPUs=2\n\
             PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n",
            folder.display()
        );
        fs::write(&settings, text).expect("settings");
        let daemon = |name: &str| {
            let log = fs::File::create(folder.join(format!("{name}.log"))).expect("a log");
            let mut command = workspace.command(name);
            command.args(["-D", "-f"]).arg(&settings).stdout(Stdio::null()).stderr(log).spawn().expect("a daemon")
        };
        let slurm = Slurm { daemons: vec![daemon("slurmctld"), daemon("slurmd")], settings };
        wait_until("the node does not come up", || {
            slurm.asked(workspace, "sinfo", &["-h", "-o", "%T"]).contains("idle")
        });
        slurm
    }

    /// What a program of Slurm prints. It is asked again and again: each time a moment later.
    fn asked(&self, workspace: &Workspace, program: &str, arguments: &[&str]) -> String {
        sleep(Duration::from_millis(100));
        let output =
            workspace.command(program).args(arguments).env("SLURM_CONF", &self.settings).output().expect("Slurm");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Hands a script in and returns the job's number.
    fn submitted(&self, workspace: &Workspace, script: &Path) -> String {
        let job = self.asked(workspace, "sbatch", &["--parsable", &script.display().to_string()]).trim().to_owned();
        assert!(job.parse::<u32>().is_ok(), "sbatch says {job:?}");
        job
    }

    /// Waits for a job's end and returns how many of its tasks are in each state.
    fn ended(&self, workspace: &Workspace, job: &str) -> [usize; 2] {
        wait_until("the job does not end", || self.asked(workspace, "squeue", &["-h", "-j", job]).is_empty());
        let tasks = self.asked(workspace, "scontrol", &["show", "job", job]);
        ["JobState=COMPLETED", "JobState=FAILED"].map(|state| tasks.matches(state).count())
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        // The node first: it reports to the other.
        for daemon in self.daemons.iter_mut().rev() {
            let _ = Command::new("kill").arg(daemon.id().to_string()).status();
            let _ = daemon.wait();
        }
    }
}

fn slurm_on_one_node() {
    let workspace = Workspace::new();
    let expected = workspace.alone();
    let slurm = Slurm::start(&workspace);
    let script = workspace.script("#!/bin/sh\n# Slurm", "runs/slurm");
    let job = slurm.submitted(&workspace, &script);
    assert_eq!(slurm.ended(&workspace, &job), [7, 1], "one of eight tasks failed");
    assert_eq!(workspace.jobs("runs/slurm").len(), expected.len() - 1, "the killed worker's job is missing");
    let again = slurm.submitted(&workspace, &script);
    assert_eq!(slurm.ended(&workspace, &again), [8, 0]);
    workspace.assert_whole("runs/slurm", &expected);
}
