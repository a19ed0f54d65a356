"""What a flight was, without what the log has besides: a digest of the vehicle's motion and inputs, for tests/golden/flights.json."""
import hashlib
import json
import pathlib

# Columns of trace.csv that the digest covers: time, states and inputs. New columns, faults and metrics change none of them. Of a vehicle with
# other rotors they are those before the reference.
COLUMNS = ("t_s x_m y_m z_m roll_rad pitch_rad yaw_rad alpha_r_rad alpha_l_rad vx_m_s vy_m_s vz_m_s wx_rad_s wy_rad_s wz_rad_s alpha_r_rad_s alpha_l_rad_s "
           "f_r_n f_l_n tau_r_nm tau_l_nm").split()


def digest(trace):
    """Of the texts in these columns, which hold every bit of the numbers."""
    result = hashlib.sha256()
    with open(trace, newline="") as file:
        header = next(file).rstrip("\r\n").split(",")  # the csv module takes twice as long, and no field has quotes
        columns = COLUMNS if set(COLUMNS) <= set(header) else header[: header.index("x_ref_m")]
        places = [header.index(column) for column in columns]
        behind = max(places) + 1
        for row in file:
            texts = row.rstrip("\r\n").split(",", behind)
            result.update((",".join([texts[place] for place in places]) + "\n").encode())
    return result.hexdigest()[:16]


def flown(results):
    """By name, the verdict and the digest of every flight in a folder of results that flew."""
    results = pathlib.Path(results)
    flights = json.loads((results / "results.json").read_text())["scenarios"]
    return {flight["name"]: f"{flight['verdict']} {digest(results / flight['name'] / 'trace.csv')}"
            for flight in flights if flight["verdict"] != "not_applicable"}
