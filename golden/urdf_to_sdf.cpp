// urdf_to_sdf FILE.urdf: converts a model to SDF with the converter of libsdformat and prints it. Exit status 1 with its messages if it finds anything wrong.
//
//     g++ -O1 -std=c++17 golden/urdf_to_sdf.cpp -o urdf_to_sdf $(pkg-config --cflags --libs sdformat12)
#include <iostream>
#include <sdf/sdf.hh>

int main(int, char **arguments) {
    sdf::Errors errors;
    const auto document = sdf::readFile(arguments[1], errors);
    for (const auto &error : errors) std::cerr << error << std::endl;
    if (!errors.empty() || !document) return 1;
    std::cout << document->ToString();
    return 0;
}
