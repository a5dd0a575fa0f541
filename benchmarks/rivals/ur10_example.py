"""The data of FIGAROH's own UR10 example, rebuilt from its published numbers.

The example (`examples/ur10/identification_reference.py` of github.com/thanhndv212/figaroh-examples, the first example in the README of FIGAROH 1.0.2) has a robot
with known parameters: the inertias of a UR10e with camera and tool, with random changes. Its folder `data/truth` (`manifest.json` of commit 98345176 and
`truth_parameters.csv`) contains the true parameters, the rest points of the training motion (from FIGAROH's optimiser), the Fourier coefficients of the
held-out motion, and levels and seeds of the noise. `rebuild` computes the samples from them, and fails if the torques differ from the published ones.
"""
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio

JOINTS = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
RATE_HZ = 100.0
# Torque noise as a fraction of the rms torque of the joint in training; position noise, rad.
NOISE = {"low": (0.01, 1e-5), "high": (0.05, 1e-4)}
SEEDS = [(101, 201), (102, 202), (103, 203), (104, 204), (105, 205)]

# Placement of each joint in the body before it: x y z, roll pitch yaw.
PLACEMENTS = [
    ((0.0, 0.0, 0.1807), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (1.570796327, 0.0, 0.0)),
    ((-0.6127, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((-0.57155, 0.0, 0.17415), (0.0, 0.0, 0.0)),
    ((0.0, -0.11985, -2.458164590756244e-11), (1.570796327, 0.0, 0.0)),
    ((0.0, 0.11655, -2.390480459346185e-11), (1.570796326589793, 3.141592653589793, 3.141592653589793)),
]
# m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the frame of the joint: true values, and values of the robot description.
TRUTH = np.array([
    [9.2785424448557379, 0.074257512849005267, 0.18162523855835286, 0.41584445326358582, 0.056064381884902571, -0.0020089596323490944, 0.059896101501369682, -0.0031152023030816644, -0.0086161252780670369, 0.029054883664591608],
    [13.11759619519256, -3.6324529832947858, 0.19965971135572402, 2.3275010088266241, 0.4724957659450626, 0.14358514888394841, 1.967482800655306, 0.67481034607286394, -0.04071676833499753, 1.5706657882377348],
    [2.9980303572357689, -0.81757075751537134, 0.051832119321485869, 0.073321927814225363, 0.032298790190650635, -0.01200278696243681, 0.33162376306504676, 0.046952244625396225, 0.0070361746218430389, 0.3252772353116774],
    [1.9906062006934069, 0.015055453127798574, -0.03534463628239469, -0.078859714639162998, 0.0088004671270781737, 0.0003269666689367185, 0.0089898255083484049, 0.00049664802887759176, -0.0015451098200619745, 0.00706653446458721],
    [1.7648914317478046, -0.050123549805107311, -0.060227632793615558, 0.068858135606180454, 0.0093929984597866632, -0.0017157972731551932, 0.0083896514947694543, 0.00194821686452912, 0.0022873440554121616, 0.0081370175684554735],
    [0.43339981644363229, 0.0021084995685269801, -0.013159920160940702, -0.014521986743939504, 0.004749118229401157, 7.909625058031388e-05, 0.006676657912177847, -0.00034265986279775039, -0.00032905630356971482, 0.0076441421947078033],
])
NOMINAL = np.array([
    [7.778, 0.0, 0.0, 0.0, 0.031474312576936593, 0.0, 0.031474312576936593, 0.0, 0.0, 0.021875624999999996],
    [12.93, -3.95658, 0.0, 2.26275, 0.432346875, 0.0, 2.0284485337984108, 0.69240149999999978, 0.0, 1.6324672837984109],
    [3.87, -1.1059492499999997, 0.0, 0.15209099999999995, 0.0168615513, 0.0, 0.43282284870777182, 0.043463805524999947, 0.0, 0.42684567240777183],
    [1.96, 0.0, 0.0, 0.0, 0.0051082479566999994, 0.0, 0.0051082479566999994, 0.0, 0.0, 0.0055124999999999992],
    [1.96, 0.0, 0.0, 0.0, 0.0051082479566999994, 0.0, 0.0051082479566999994, 0.0, 0.0, 0.0055124999999999992],
    [0.474, -0.0013618153318366135, -0.0095502871808523376, -0.0046899895245451704, 0.0038666771550539963, -0.00018652554541069523, 0.0061748731375646689, 4.0949299973973887e-06, 4.5182723511901787e-05, 0.0072031825645269172],
])
# At rest at each point; 2 s between points.
INTERVAL_S = 2.0
WAYPOINTS = np.array([
    [-2.5132741228718345, -1.4707963267948965, 1.315240771239341, -0.82412966012823, -1.6007963267948966, -0.5099999999999999],
    [-0.7261019505813393, -2.280786658589354, 1.670626688937637, -0.6109634237535296, -0.9088629333529477, 0.9291867874604124],
    [1.0611062570784904, -2.2807797812894544, 1.6541237099995358, -1.8822690587645547, -1.6176665817972848, 0.929537602510792],
    [1.1468330676576437, -2.2807219876963005, 0.8611346074757551, -2.5542677710744144, -1.6175643149230128, -1.2565836133854085],
    [1.1477696286386552, -2.2807686394722166, 1.6669722043974715, -2.0361819177274825, -0.2416399944214328, -1.256647224361393],
    [-0.6840760589421574, -1.470808557827726, 1.670529874236088, -2.035861559847619, -0.6300450729427165, -1.256187591783555],
    [1.103125573619561, -1.470819624609546, 1.6707277276940282, -0.6114673665988571, -0.24120098061144774, 0.9297256729327524],
    [0.8274465183100065, -1.4725927231694123, 1.6527155648228369, -2.5004349134131405, -0.34207548043710223, -1.2016330887867506],
    [-0.9953360413586593, -2.2801646093506553, 1.1476778154118472, -2.5443284169259153, -1.5991521308658763, -1.2191178923460815],
    [0.7912056207408595, -2.2798973043866955, 0.9158083869228285, -2.53424994976349, -1.6039563472616767, -1.235218920439196],
    [0.6935375972653117, -2.279562450163391, 1.293058427884573, -0.6583305250160051, -1.1328832743603279, -1.2351219164872007],
    [2.4712588506966546, -1.4715992291311961, 0.9434808295515307, -0.6231567428606121, -1.170834407104006, 0.9176642375727977],
    [0.6401294248454638, -1.4716611636075223, 0.876042773181192, -1.6236656362101733, -0.8895649933572499, 0.905386137578211],
])
# q = c + sum over k of (a sin(k w t) - b cos(k w t)) / (k w), for one period of 8 s.
FUNDAMENTAL_HZ = 0.125
CENTRE = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
FOURIER_A = np.array([
    [-0.3022074515567861, -0.2332151974616385, 0.263937031653183, -0.1729794164658556, -0.26977372456248744],
    [0.27617731939610163, -0.09596427392767183, 0.5032664845868668, -0.014384942282694631, 0.1536680239525377],
    [0.14918642606967017, -0.7071287787296616, -0.25452770561939797, 0.4752038282929206, -0.08709075020500395],
    [-0.40585986963154674, -0.12630621131141886, 0.6638993885956478, -0.513107640539078, 0.40012410266752174],
    [-0.5147450994499474, 0.23067198424170357, 0.2751231836319485, 0.21571637348000836, 0.37019245447774285],
    [0.5861583096636384, -0.09517765905796839, -0.31644485403533906, -0.3869576879779251, -0.38517895442092975],
])
FOURIER_B = np.array([
    [0.0197615149857371, -0.3390668484815534, -0.40903775095529993, -0.33249625631414115, -0.251256404949388],
    [-0.44762121085552325, 0.14326141255823183, 0.10885934639023558, 0.43771762122337854, -0.22634989572727618],
    [0.17079234316740466, 0.22922849552492228, -0.2685454159176062, -0.6312876353045952, 0.30402263089502196],
    [0.5477244532759694, -0.3013763105284892, -0.41804303555537975, -0.3208915725721279, 0.4306235260587514],
    [-0.10242289856633244, -0.5901986238598665, -0.519117573399275, -0.1812936949620261, -0.22652005056650124],
    [-0.5697207171218389, 0.287612034611664, -0.4928942885821802, 0.042349743914560437, -0.1721772301089911],
])
# Published rms of the torque of every joint, Nm.
TORQUE_RMS = {
    "train": [3.456421450724977, 38.00279215134282, 26.5945862865316, 2.8278266833172605, 0.26239810184429246, 0.06770635878003992],
    "test": [7.759283955747246, 54.66431748399907, 29.389567873504053, 3.218740356654215, 0.35986474106853267, 0.06684257442656619],
}


@dataclass
class Recording:
    """One motion: true values (`q`, `dq`, `ddq`, `tau`) and recorded values (`q_measured`, `tau_measured`)."""

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    q_measured: np.ndarray
    tau_measured: np.ndarray


def urdf(bodies):
    """The robot with these bodies; each has ten numbers as in `TRUTH`."""
    parts = ['<robot name="ur10e"><link name="base"/>']
    parent = "base"
    for joint, (xyz, rpy), (m, mx, my, mz, xx, xy, yy, xz, yz, zz) in zip(JOINTS, PLACEMENTS, bodies):
        link = joint.replace("joint", "link")
        c = np.array([mx, my, mz]) / m
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - m * (c @ c * np.eye(3) - np.outer(c, c))
        numbers = dict(ixx=about[0, 0], ixy=about[0, 1], ixz=about[0, 2], iyy=about[1, 1], iyz=about[1, 2], izz=about[2, 2])
        inertia = " ".join(f'{key}="{float(value)!r}"' for key, value in numbers.items())
        parts.append(
            f'<link name="{link}"><inertial><mass value="{float(m)!r}"/><origin rpy="0 0 0" xyz="{" ".join(repr(float(one)) for one in c)}"/>'
            f"<inertia {inertia}/></inertial></link>"
            f'<joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{link}"/>'
            f'<origin xyz="{" ".join(map(repr, xyz))}" rpy="{" ".join(map(repr, rpy))}"/><axis xyz="0 0 1"/>'
            '<limit lower="-6.283185307179586" upper="6.283185307179586" effort="330" velocity="3.141592653589793"/></joint>'
        )
        parent = link
    return "".join(parts) + "</robot>"


def between_rests():
    """Fifth-order polynomials from rest to rest: q, dq, ddq at 100 Hz."""
    t = np.arange((len(WAYPOINTS) - 1) * int(INTERVAL_S * RATE_HZ)) / RATE_HZ
    piece = (t // INTERVAL_S).astype(int)
    s = (t / INTERVAL_S - piece)[:, None]
    start, way = WAYPOINTS[piece], np.diff(WAYPOINTS, axis=0)[piece]
    q = start + way * (10 * s**3 - 15 * s**4 + 6 * s**5)
    dq = way * (30 * s**2 - 60 * s**3 + 30 * s**4) / INTERVAL_S
    return t, q, dq, way * (60 * s - 180 * s**2 + 120 * s**3) / INTERVAL_S**2


def fourier():
    """One period of the held-out motion: q, dq, ddq at 100 Hz."""
    t = np.arange(int(RATE_HZ / FUNDAMENTAL_HZ)) / RATE_HZ
    kw = 2 * np.pi * FUNDAMENTAL_HZ * np.arange(1, FOURIER_A.shape[1] + 1)
    sine, cosine = np.sin(np.outer(t, kw)), np.cos(np.outer(t, kw))
    q = CENTRE + sine @ (FOURIER_A / kw).T - cosine @ (FOURIER_B / kw).T
    return t, q, cosine @ FOURIER_A.T + sine @ FOURIER_B.T, -sine @ (FOURIER_A * kw).T + cosine @ (FOURIER_B * kw).T


def torques(model, q, dq, ddq):
    data = model.createData()
    return np.array([pinocchio.rnea(model, data, *one) for one in zip(q, dq, ddq)])


def rebuild(noise, seeds):
    """The training and validation recordings, with noise level `noise` from these seeds."""
    truth = pinocchio.buildModelFromXML(urdf(TRUTH))
    recordings = {}
    effort, position = NOISE[noise]
    sigma = effort * np.array(TORQUE_RMS["train"])
    for (name, motion), seed in zip({"train": between_rests(), "test": fourier()}.items(), seeds):
        tau = torques(truth, *motion[1:])
        rms = np.sqrt(np.mean(tau**2, axis=0))
        if not np.allclose(rms, TORQUE_RMS[name], rtol=1e-9):
            raise RuntimeError(f"{name}: the torques differ from FIGAROH's: rms {rms.tolist()}, expected {TORQUE_RMS[name]}")
        draw = np.random.RandomState(seed)
        noise_tau, noise_q = draw.standard_normal(tau.shape), draw.standard_normal(tau.shape)
        recordings[name] = Recording(*motion, tau, motion[1] + position * noise_q, tau + sigma * noise_tau)
    agree_with_mujoco(recordings["test"])
    return recordings["train"], recordings["test"]


def agree_with_mujoco(recording):
    """Checks that MuJoCo's inverse dynamics of the same robot give the same torques as Pinocchio's."""
    spec = mujoco.MjSpec.from_string(urdf(TRUTH))
    spec.compiler.boundmass = spec.compiler.boundinertia = 0.0
    model = spec.compile()
    data = mujoco.MjData(model)
    for q, dq, ddq, tau in list(zip(recording.q, recording.dq, recording.ddq, recording.tau))[::50]:
        data.qpos, data.qvel, data.qacc = q, dq, ddq
        mujoco.mj_inverse(model, data)
        if not np.allclose(data.qfrc_inverse, tau, atol=1e-6):
            raise RuntimeError(f"MuJoCo and Pinocchio give different torques: {data.qfrc_inverse} and {tau} Nm")
