function build()
    % build  Compile fracgyro_mex for Fracgyro: with mex in MATLAB, with mkoctfile in Octave.
    %
    % It needs gcc, clang or MinGW, with C++20.
    before = pwd();
    back = onCleanup(@() cd(before));
    cd(fileparts(mfilename('fullpath')));
    flags = '-std=c++20 -O2 FRACGYRO_BITS';
    words = {'-Ifirmware', '-Ifirmware/include', 'fracgyro_mex.cpp', 'firmware/fracgyro.cpp'};
    if exist('OCTAVE_VERSION', 'builtin')
        set_before = getenv('CXXFLAGS');
        unset = onCleanup(@() setenv('CXXFLAGS', set_before));
        setenv('CXXFLAGS', strtrim([mkoctfile('-p', 'CXXFLAGS') ' ' flags]));
        [~, status] = mkoctfile('--mex', words{:}, '-o', 'fracgyro_mex');
        if status ~= 0
            error('fracgyro:build', 'mkoctfile failed: what the compiler said stands above');
        end
    else
        mex('-silent', ['CXXFLAGS=$CXXFLAGS ' flags], words{:}, '-output', 'fracgyro_mex');
    end
end
