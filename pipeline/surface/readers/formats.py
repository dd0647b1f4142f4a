"""The formats: names, suffixes, and which library reads them; formats that are recognised and cannot be read."""

from dataclasses import dataclass

OWN, LIBRARY = "diffract-bake", "SurfaceTopography"


@dataclass(frozen=True)
class Format:
    """One format.

    key: its name in sniff.py, and in SurfaceTopography for that library's formats. name: in words. suffixes: usual
    ones. reader: the library that reads it. Tests read a file of each format.
    """

    key: str
    name: str
    suffixes: tuple[str, ...]
    reader: str


READ = (
    Format("image", "grey image", (".png", ".tif", ".tiff", ".bmp"), "Pillow, tifffile"),
    Format("npy", "NumPy .npy", (".npy",), "numpy"),
    Format("npz", "NumPy .npz", (".npz",), "numpy"),
    Format("text", "text matrix or x y z triples", (".txt", ".csv", ".asc", ".xyz", ".dat"), OWN),
    Format("gwyddion", "Gwyddion .gwy", (".gwy",), "gwyfile"),
    Format("gsf", "Gwyddion .gsf", (".gsf",), OWN),
    Format("nanonis", "Nanonis .sxm", (".sxm",), "nanonispy2"),
    Format("nanosurf", "Nanosurf .nid/.ezd", (".nid", ".ezd"), OWN),
    Format("nhf", "Nanosurf .nhf", (".nhf",), "h5py"),
    Format("h5jpk", "JPK .h5-jpk", (".h5-jpk",), "h5py"),
    Format("di", "Bruker/Veeco Nanoscope", (".spm", ".000", ".001", ".di"), LIBRARY),
    Format("ibw", "Igor binary wave", (".ibw",), LIBRARY),
    Format("jpk", "JPK image scan", (".jpk", ".jpk-qi-image"), LIBRARY),
    Format("wsxm", "WSxM", (".top", ".stp", ".cur", ".tom"), LIBRARY),
    Format("mi", "Agilent/Molecular Imaging .mi", (".mi",), LIBRARY),
    Format("ps", "Park Systems TIFF", (".tiff", ".tif"), LIBRARY),
    Format("mdt", "NT-MDT .mdt", (".mdt",), LIBRARY),
    Format("bcr", "BCR-STM/BCRF (SPIP, DME)", (".bcr", ".bcrf"), LIBRARY),
    Format("sdf", "ISO 25178-71 .sdf", (".sdf",), LIBRARY),
    Format("x3p", "ISO 25178-72 .x3p", (".x3p",), LIBRARY),
    Format("sur", "Digital Surf .sur", (".sur",), LIBRARY),
    Format("mnt", "Digital Surf Mountains .mnt", (".mnt",), LIBRARY),
    Format("opd", "Wyko .opd", (".opd",), LIBRARY),
    Format("opdx", "Dektak .OPDx", (".opdx",), LIBRARY),
    Format("asc", "Wyko ASCII", (".asc",), LIBRARY),
    Format("metropro", "Zygo MetroPro .dat", (".dat",), LIBRARY),
    Format("datx", "Zygo .datx", (".datx",), LIBRARY),
    Format("plu", "Sensofar .plu", (".plu", ".apx"), LIBRARY),
    Format("plux", "Sensofar .plux", (".plux",), LIBRARY),
    Format("al3d", "Alicona .al3d", (".al3d",), LIBRARY),
    Format("frt", "FRT MicroProf .frt", (".frt",), LIBRARY),
    Format("nms", "NanoFocus .nms", (".nms",), LIBRARY),
    Format("os3d", "OmniSurf3D .os3d", (".os3d",), LIBRARY),
    Format("tmd", "TrueMap .tmd", (".tmd",), LIBRARY),
    Format("vk", "Keyence .vk3/.vk4/.vk6/.vk7", (".vk3", ".vk4", ".vk6", ".vk7"), LIBRARY),
    Format("zon", "Keyence .zon", (".zon",), LIBRARY),
    Format("zmg", "KLA Zeta .zmg", (".zmg",), LIBRARY),
    Format("lext", "Olympus LEXT", (".lext",), LIBRARY),
    Format("oir", "Olympus .oir", (".oir",), LIBRARY),
    Format("poir", "Olympus .poir", (".poir",), LIBRARY),
    Format("nmm", "nano measuring machine .zip", (".zip",), LIBRARY),
    Format("nc", "NetCDF", (".nc",), LIBRARY),
    Format("mat", "MATLAB .mat", (".mat",), LIBRARY),
    Format("h5", "HDF5", (".h5", ".hdf5"), LIBRARY),
)
BY_LIBRARY = {entry.key: entry.name for entry in READ if entry.reader == LIBRARY}

# recognised by their first bytes, and not read
NOT_READ = (
    (b"ONTMATRX", "an Omicron MATRIX file (.Z_mtrx, .mtrx)"),
    (b"[Paramet32]", "a Createc .dat file"),
    (b"[Paramco32]", "a Createc .dat file"),
    (b"[Parameter]", "a Createc .dat file"),
    (b"DSCOMPRESSED", "a compressed Digital Surf file"),
    (b"DSBB", "a Surfer binary grid"),
    (b"DSRB", "a Surfer 7 grid"),
    (b"DSAA", "a Surfer text grid"),
    (b"Zygo XYZ Data File", "a Zygo XYZ text file"),
    (b"Zygo ASCII Data File", "a Zygo text file"),
    (b"\xffOIB", "an Olympus image"),
    (b"SemperData", "a Semper image"),
    (b"STiMage", "an RHK .sm4 file"),
    (b"S\x00T\x00i\x00M\x00a\x00g\x00e\x00", "an RHK .sm4 file"),
)
# recognised by their suffix beside a container's bytes, and not read
NOT_READ_SUFFIXES = {
    ".jpk-force": "JPK force curves",
    ".jpk-force-map": "a JPK force map",
    ".jpk-qi-data": "JPK QI data (their image is the .jpk-qi-image)",
    ".asd": "an Asahi/RIBM .asd movie",
    ".ardf": "an Asylum .ardf force map",
    ".sm4": "an RHK .sm4 file",
    ".par": "an Omicron SCALA header",
    ".xqd": "an XQD file",
    ".hdf": "an HDF file",
}
